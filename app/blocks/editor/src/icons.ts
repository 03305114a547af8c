// Lucide icons (ISC) as inlined path data, coloured by CSS.
import lucide from 'virtual:icons';
import {categoryIcon} from './tokens';

const SVG_NS = 'http://www.w3.org/2000/svg';

/** Our own filled glyphs, on the same 24 x 24 grid. */
const FILLED_ICONS: Readonly<Record<string, string>> = {
  'quote-open':
    '<path d="M10.6 5.2C6 6.6 3 10 3 14.3 3 17 4.600 18.800 6.900 18.800c2.100 0 3.600-1.500 3.600-3.500' +
    ' 0-1.900-1.300-3.200-3.100-3.300.2-1.900 1.700-3.400 4-4.200zM21 5.200c-4.600 1.400-7.600 4.800-7.600 9.100' +
    ' 0 2.700 1.600 4.500 3.900 4.500 2.100 0 3.600-1.500 3.600-3.500 0-1.900-1.300-3.200-3.100-3.300.2-1.900' +
    ' 1.700-3.400 4-4.200z"/>',
  'quote-close':
    '<path d="M13.400 18.800c4.600-1.400 7.600-4.800 7.600-9.100 0-2.700-1.600-4.500-3.900-4.500-2.100 0-3.600 1.500-3.600 3.500' +
    ' 0 1.900 1.300 3.200 3.100 3.300-.2 1.900-1.700 3.400-4 4.200zM3 18.800c4.600-1.400 7.600-4.800 7.600-9.100' +
    ' 0-2.700-1.600-4.500-3.900-4.500-2.100 0-3.600 1.500-3.600 3.500 0 1.900 1.300 3.200 3.100 3.300-.2 1.900-1.700' +
    ' 3.400-4 4.200z"/>',
};

/** Returns the name if such an icon exists, otherwise the icon of the category (block style). */
export function iconName(name: string, style: string): string {
  if (Object.hasOwn(lucide, name) || Object.hasOwn(FILLED_ICONS, name)) return name;
  const fallback = categoryIcon(style);
  return Object.hasOwn(lucide, fallback) ? fallback : 'circle-dot';
}

/** Parsed icons, which are cloned for each use. */
const iconCache = new Map<string, SVGElement>();

/** Fills `group` with the icon, scaled to `size` units and coloured by CSS. */
export function drawIcon(group: Element, name: string, size: number): void {
  const key = `${size} ${name}`;
  let drawn = iconCache.get(key);
  if (!drawn) {
    const filled = FILLED_ICONS[name];
    const wrapper = document.createElementNS(SVG_NS, 'g');
    wrapper.innerHTML = filled ?? lucide[name] ?? '';
    const only = wrapper.childElementCount === 1 ? wrapper.firstElementChild : null;
    drawn = only instanceof SVGElement ? only : wrapper;
    drawn.setAttribute('transform', `scale(${size / 24})`);
    drawn.setAttribute('class', filled ? 'nepGlyph' : 'nepLines');
    iconCache.set(key, drawn);
  }
  group.replaceChildren(drawn.cloneNode(true));
}

/** Returns the icon as an <svg> element for HTML (toolbox, buttons). */
export function iconElement(name: string, size: number, stroke = 2): SVGSVGElement {
  const svg = document.createElementNS(SVG_NS, 'svg');
  svg.setAttribute('viewBox', '0 0 24 24');
  svg.setAttribute('width', String(size));
  svg.setAttribute('height', String(size));
  svg.setAttribute('class', 'nepLines');
  svg.setAttribute('stroke-width', String(stroke));
  svg.setAttribute('aria-hidden', 'true');
  svg.innerHTML = lucide[name] ?? '';
  return svg;
}
