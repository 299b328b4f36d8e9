// Short forms for the page's elements.

export const $ = (id) => document.getElementById(id);

/** Set a text unless it is the same: screen readers announce live texts at each change. */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
