// Helpers: elements are created once; later only changes are applied.

const SVG = "http://www.w3.org/2000/svg";

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

export function h(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setAttribute(element, name, value) {
  if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
}

export function setClass(element, name, on) {
  element.classList.toggle(name, Boolean(on));
}

// One child of `parent` for each key, in that order, behind the first `after` children; `make(key)` returns an object with `.root`.
export class Keyed {
  constructor(parent, make, after = 0) {
    this.parent = parent;
    this.after = after;
    this.make = make;
    this.items = new Map();
  }

  sync(keys) {
    for (const [key, item] of this.items) {
      if (!keys.includes(key)) {
        item.root.remove();
        this.items.delete(key);
      }
    }
    keys.forEach((key, i) => {
      const place = i + this.after;
      if (!this.items.has(key)) this.items.set(key, this.make(key));
      const root = this.items.get(key).root;
      if (this.parent.children[place] !== root) this.parent.insertBefore(root, this.parent.children[place] ?? null);
    });
    return this.items;
  }
}

export function panelTitle(text, note = "") {
  const side = h("span", { class: "note" }, note);
  return { root: h("h2", {}, h("span", {}, text), side), side };
}
