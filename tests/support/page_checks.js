// What a page shows that its reader could not read: run in the page, returns a list of faults.
(() => {
  const faults = [];
  const numbers = (text) => text.match(/[\d.]+/g).map(Number);
  const over = (front, back) => {
    const alpha = front.length > 3 ? front[3] : 1;
    return [0, 1, 2].map((k) => alpha * front[k] + (1 - alpha) * back[k]);
  };
  const shade = (colour) => {
    const [r, g, b] = colour.map((c) => ((c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    const chain = [];
    for (let node = element; node; node = node.parentElement) chain.push(node);
    return chain.reverse().reduce((back, node) => {
      const colour = getComputedStyle(node).backgroundColor;
      return colour && colour !== "transparent" ? over(numbers(colour), back) : back;
    }, [255, 255, 255]);
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const text = walker.currentNode.data.trim(), element = walker.currentNode.parentElement;
    if (!text || element.closest("script, style, noscript, svg") || !element.checkVisibility()) continue;
    const style = getComputedStyle(element), back = behind(element);
    const [a, b] = [shade(over(numbers(style.color), back)), shade(back)].sort((x, y) => y - x);
    const size = parseFloat(style.fontSize), bold = Number(style.fontWeight) >= 700;
    const least = size >= 24 || (bold && size >= 18.66) ? 3 : 4.5; // WCAG 2.2, 1.4.3
    const contrast = (a + 0.05) / (b + 0.05);
    if (contrast < least) faults.push(`contrast ${contrast.toFixed(2)}: ${text.slice(0, 60)}`);
  }
  for (const block of document.querySelectorAll("p, li, td, figcaption")) {
    const words = block.cloneNode(true);
    words.querySelectorAll("code, pre, script, style, svg").forEach((part) => part.remove());
    const joined = words.textContent.match(/.{0,30}[a-z0-9)%][.;:,!?][A-Z][a-z].{0,20}/);
    if (joined) faults.push(`no blank: ${joined[0]}`);
  }
  for (const image of document.images) {
    const name = (image.getAttribute("alt") || image.src).slice(0, 60);
    if (!image.complete || !image.naturalWidth) faults.push(`picture not there: ${name}`);
    if (!image.getAttribute("alt")) faults.push(`picture without words: ${name}`);
  }
  for (const canvas of document.querySelectorAll("canvas")) {
    if (!canvas.closest("[aria-label], [role=img]")) faults.push("canvas without words");
  }
  if (!document.documentElement.lang) faults.push("no language");
  if (!document.title) faults.push("no title");
  if (document.querySelectorAll("h1").length !== 1) faults.push("not one heading of the first level");
  if (!document.querySelector("meta[name=viewport]")) faults.push("no viewport");
  return [...new Set(faults)];
})()
