// The owner's key: it comes in the address (#key=...), leaves the address bar at once, and stays in this tab.

const NAME = "fti-key";

// Null: this page may only look.
export function takeKey() {
  const found = new URLSearchParams(location.hash.slice(1)).get("key");
  if (found !== null) {
    sessionStorage.setItem(NAME, found);
    history.replaceState(null, "", location.pathname + location.search);
  }
  return sessionStorage.getItem(NAME);
}
