// The command key: read from the address (#key=...), removed from the address bar, stored for this tab.

const NAME = "fti-key";

// Null: this page is read-only.
export function takeKey() {
  const found = new URLSearchParams(location.hash.slice(1)).get("key");
  if (found !== null) {
    sessionStorage.setItem(NAME, found);
    history.replaceState(null, "", location.pathname + location.search);
  }
  return sessionStorage.getItem(NAME);
}
