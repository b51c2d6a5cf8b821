// Elements made from text only: whatever a name or an event contains is shown as it is, never taken for markup.

export const byId = (id) => document.getElementById(id);

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "class") made.className = value;
    else if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, String(value));
  }
  made.append(...children.map((child) => (child instanceof Node ? child : document.createTextNode(String(child)))));
  return made;
}

export function button(text, onclick, attributes = {}) {
  return element("button", { type: "button", onclick, ...attributes }, text);
}

// A line that is seen for a while: what was done, or why not.
let hideAt = 0;
export function say(text, bad = false) {
  const said = byId("said");
  said.textContent = text;
  said.className = bad ? "shown bad" : "shown";
  clearTimeout(hideAt);
  hideAt = setTimeout(() => (said.className = ""), bad ? 6000 : 3000);
}

export function seconds(t) {
  return `${t.toFixed(1)} s`;
}
