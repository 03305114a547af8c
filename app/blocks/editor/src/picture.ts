// Picture of all blocks of a behaviour, including those outside the view: self-contained SVG with styles and
// fonts, or a PNG of it. The visible canvas doesn't change; run states and outlines are left out.
import * as Blockly from 'blockly/core';
import {flushTypedText, blockIdOf} from './notes';

const SVG_NS = 'http://www.w3.org/2000/svg';
/** Margin around the blocks; leaves room for the signs at their left, which are 20 wide. */
const MARGIN = 32;
const SCALE = 2;
/** Height above which a rectangle is the body of a note and not its header. */
const NOTE_HEADER_HEIGHT = 30;
/** Limits of a canvas in Chromium: length of a side, and total pixels. */
const MAX_SIDE_PX = 16_000;
const MAX_PIXELS = 120_000_000;

/** Relevant style properties with their initial values, which are not written. */
const STYLE_DEFAULTS: Readonly<Record<string, string>> = {
  'fill': 'rgb(0, 0, 0)', 'fill-opacity': '1', 'fill-rule': 'nonzero', 'stroke': 'none', 'stroke-width': '1px', 'stroke-opacity': '1',
  'stroke-linecap': 'butt', 'stroke-linejoin': 'miter', 'stroke-dasharray': 'none', 'opacity': '1', 'paint-order': 'normal',
};
const TEXT_PROPERTIES: readonly string[] = ['font-family', 'font-size', 'font-weight', 'text-anchor', 'dominant-baseline'];
const GEOMETRY_ATTRIBUTES: readonly string[] = ['d', 'x', 'y', 'width', 'height', 'rx', 'ry', 'cx', 'cy', 'r', 'x1', 'y1', 'x2', 'y2', 'points',
  'transform', 'href', 'viewBox', 'dy', 'dx'];
const EXCLUDED_SELECTOR = '.nepState, .nepSelection, .nepTryHandle, .nepNoteButton, .blocklyInsertionMarker, .blocklyHighlightedConnectionPath, ' +
  '.blocklyResizeHandle, .blocklyFoldoutIcon, .blocklyDeleteIcon, .blocklyConnectionIndicator, title';

export interface Picture {
  svg: string;
  width: number;
  height: number;
}

/** Rendered item of the canvas: a stack, a note, or the note of a block, which belongs to its stack. */
export interface RenderedItem {
  item: unknown;
  box: Blockly.utils.Rect;
  drawn: SVGElement | null;
}

/** Renders all items, or `only` these, with inline styles; adds the fill patterns in use to `patterns` by id. */
export function renderItems(workspace: Blockly.WorkspaceSvg, patterns: Map<string, SVGElement>, only?: ReadonlySet<unknown>): RenderedItem[] {
  flushTypedText();
  Blockly.renderManagement.triggerQueuedRenders();
  const all = [...workspace.getTopBlocks(true), ...workspace.getTopComments()] as (Blockly.IBoundedElement & {
    getSvgRoot?(): SVGElement; view?: {getSvgRoot(): SVGElement};
  })[];
  const items = all.filter((item) => !only || only.has(item));
  const renderedItems = items.map((item): RenderedItem => ({item, box: item.getBoundingRectangle(),
    drawn: cloneWithStyles(item.getSvgRoot?.() ?? item.view!.getSvgRoot(), patterns)}));
  for (const sheet of workspace.getBubbleCanvas().querySelectorAll<SVGGElement>('.nepNote')) {
    const owner = workspace.getBlockById(blockIdOf(sheet))?.getRootBlock();
    if (only && !only.has(owner)) continue;
    const {x, y, width, height} = sheet.getBBox();
    const {e, f} = sheet.transform.baseVal.consolidate()?.matrix ?? {e: 0, f: 0};
    renderedItems.push({item: owner,
      box: new Blockly.utils.Rect(y + f, y + f + height, x + e, x + e + width), drawn: cloneWithStyles(sheet, patterns)});
  }
  return renderedItems;
}

/**
 * Returns the picture, or null if the canvas is empty. Uses the current theme: call with the light theme, except
 * for a drag image (`only`).
 */
export async function createPicture(workspace: Blockly.WorkspaceSvg, hasWhiteBackground: boolean, only?: ReadonlySet<unknown>): Promise<Picture | null> {
  const patterns = new Map<string, SVGElement>();
  const renderedItems = renderItems(workspace, patterns, only);
  if (!renderedItems.length) return null;
  const boxes = renderedItems.map(({box}) => box);
  const drawn = renderedItems.map((item) => item.drawn);
  for (const element of drawn) if (element) truncateNote(element);
  const left = Math.floor(Math.min(...boxes.map((box) => box.left)) - MARGIN);
  const top = Math.floor(Math.min(...boxes.map((box) => box.top)) - MARGIN);
  const width = Math.ceil(Math.max(...boxes.map((box) => box.right)) + MARGIN) - left;
  const height = Math.ceil(Math.max(...boxes.map((box) => box.bottom)) + MARGIN) - top;
  const root = document.createElementNS(SVG_NS, 'svg');
  for (const [name, value] of Object.entries({width, height, viewBox: `${left} ${top} ${width} ${height}`})) root.setAttribute(name, `${value}`);
  const style = document.createElementNS(SVG_NS, 'style');
  const fonts = new Set(drawn.flatMap((element) => [...element?.querySelectorAll('text') ?? []].flatMap(fontsOf)));
  const defs = document.createElementNS(SVG_NS, 'defs');
  defs.append(...patterns.values());
  root.append(style, defs);
  if (hasWhiteBackground) {
    const ground = document.createElementNS(SVG_NS, 'rect');
    for (const [name, value] of Object.entries({x: left, y: top, width, height, fill: '#ffffff'})) ground.setAttribute(name, `${value}`);
    root.append(ground);
  }
  root.append(...drawn.filter((element) => element !== null));
  style.textContent = (await Promise.all([...fonts].map(fontFace))).join('\n');
  return {svg: new XMLSerializer().serializeToString(root), width, height};
}

/** Returns the picture as a `data:` URL of a PNG at `requestedScale`, reduced if the canvas limits require it. */
export async function renderPng({svg, width, height}: Picture, requestedScale = SCALE): Promise<string> {
  const scale = Math.min(requestedScale, MAX_SIDE_PX / width, MAX_SIDE_PX / height, Math.sqrt(MAX_PIXELS / (width * height)));
  const image = new Image(width, height);
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
  canvas.getContext('2d')!.drawImage(image, 0, 0, canvas.width, canvas.height);
  const url = canvas.toDataURL('image/png');
  return url.slice(url.indexOf(',') + 1);
}

/** Returns a copy with inline styles, or null if the element isn't visible. */
function cloneWithStyles(source: Element, patterns: Map<string, SVGElement>): SVGElement | null {
  if (source.matches(EXCLUDED_SELECTOR)) return null;
  const style = getComputedStyle(source);
  if (style.display === 'none' || style.visibility === 'hidden' || style.opacity === '0') return null;
  if (source.localName === 'foreignObject') return createNoteText(source);
  const clone = document.createElementNS(SVG_NS, source.localName);
  for (const name of GEOMETRY_ATTRIBUTES) {
    const value = source.getAttribute(name);
    if (value !== null) clone.setAttribute(name, value);
  }
  if (source instanceof SVGGElement) {
    if (style.opacity !== '1') clone.setAttribute('opacity', style.opacity);
  } else writeStyles(source, style, clone, patterns);
  for (const child of source.childNodes) {
    if (child instanceof Element) {
      const inner = cloneWithStyles(child, patterns);
      if (inner) clone.append(inner);
    } else if (child instanceof Text && (source.localName === 'text' || source.localName === 'tspan')) {
      clone.append(child.data);
    }
  }
  return clone;
}

function writeStyles(source: Element, style: CSSStyleDeclaration, clone: SVGElement, patterns: Map<string, SVGElement>): void {
  for (const [name, usual] of Object.entries(STYLE_DEFAULTS)) {
    const value = style.getPropertyValue(name);
    if (value && value !== usual) clone.setAttribute(name, value);
  }
  if (source.localName === 'text') for (const name of TEXT_PROPERTIES) clone.setAttribute(name, style.getPropertyValue(name));
  const id = /url\("?#([^")]+)"?\)/.exec(style.fill)?.[1];
  if (!id) return;
  clone.setAttribute('fill', `url(#${id})`);
  const pattern = document.getElementById(id);
  if (!pattern || patterns.has(id)) return;
  const patternClone = pattern.cloneNode(true) as SVGElement;
  [...pattern.querySelectorAll('*')].forEach((element, index) => {
    const elementStyle = getComputedStyle(element);
    const mine = patternClone.querySelectorAll('*')[index];
    for (const name of ['fill', 'stroke']) mine?.setAttribute(name, elementStyle.getPropertyValue(name));
  });
  patterns.set(id, patternClone);
}

/** Returns the text of a note as SVG text, because other programs don't render HTML in SVG. */
function createNoteText(source: Element): SVGElement | null {
  const area = source.querySelector('textarea');
  if (!area?.value) return null;
  const style = getComputedStyle(area);
  const size = parseFloat(style.fontSize);
  const [x, y] = ['x', 'y'].map((name) => parseFloat(source.getAttribute(name) ?? '0') || 0) as [number, number];
  const [width, height] = ['width', 'height'].map((name) => parseFloat(source.getAttribute(name) ?? '0') || 0) as [number, number];
  const inset = parseFloat(style.paddingLeft) || 8;
  const rise = parseFloat(style.paddingTop) || 0;
  const lineHeight = parseFloat(style.lineHeight) || size * 1.4;
  const text = document.createElementNS(SVG_NS, 'text');
  for (const name of ['font-family', 'font-size', 'font-weight'] as const) text.setAttribute(name, style.getPropertyValue(name));
  text.setAttribute('fill', style.color);
  const lines = wrapText(area.value, width - 2 * inset, `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`);
  const room = Math.max(1, Math.floor((height - rise) / lineHeight));
  lines.forEach((line, index) => {
    const part = document.createElementNS(SVG_NS, 'tspan');
    part.setAttribute('x', `${x + inset}`);
    part.setAttribute('y', `${y + rise + size + index * lineHeight}`);
    part.textContent = line;
    text.append(part);
  });
  if (lines.length > room) Object.assign(text.dataset, {room, more: Math.ceil((lines.length - room) * lineHeight)});
  return text;
}

/** Returns the additional height that a note needs for its whole text. */
export function overflowHeight(note: SVGElement): number {
  return Number(note.querySelector<SVGElement>('[data-more]')?.dataset['more'] ?? 0);
}

/** Extends a note to the height of its text. */
export function expandNote(note: SVGElement): void {
  const more = overflowHeight(note);
  for (const ground of note.querySelectorAll('rect')) {
    const height = Number(ground.getAttribute('height'));
    if (height > NOTE_HEADER_HEIGHT) ground.setAttribute('height', `${height + more}`);
  }
}

/** Removes the lines that don't fit into a note and marks the cut with “…”. */
export function truncateNote(note: SVGElement): void {
  const text = note.querySelector<SVGElement>('[data-room]');
  if (!text) return;
  const lines = [...text.children];
  const room = Number(text.dataset['room']);
  for (const line of lines.splice(room)) line.remove();
  lines[room - 1]?.append(' …');
}

function wrapText(text: string, width: number, font: string): string[] {
  const pen = document.createElement('canvas').getContext('2d')!;
  pen.font = font;
  const lines: string[] = [];
  for (const paragraph of text.split('\n')) {
    let line = '';
    for (const word of paragraph.match(WORDS) ?? []) {
      if (line && pen.measureText((line + word).trimEnd()).width > width) {
        lines.push(line.trimEnd());
        line = word;
      } else line += word;
    }
    lines.push(line.trimEnd());
  }
  return lines;
}

const WEIGHTS: Readonly<Record<string, string>> = {'400': 'Regular', '500': 'Medium', '600': 'SemiBold', '700': 'Bold'};
const JAPANESE_WEIGHTS: Readonly<Record<string, string>> = {'400': 'Regular', '500': 'Regular', '600': 'Bold', '700': 'Bold'};
const JAPANESE = /[\u3000-\u30ff\u3400-\u9fff\uff00-\uffef]/;
/** Matches a word with the spaces after it or one Japanese character; lines may break after each. */
const WORDS = /[\u3000-\u30ff\u3400-\u9fff\uff00-\uffef] *|[^ \u3000-\u30ff\u3400-\u9fff\uff00-\uffef]+ *| +/g;

const fontFaces = new Map<string, Promise<string>>();

/** Returns the bundled fonts of a text as "file weight family". */
function fontsOf(text: SVGTextElement): string[] {
  const weight = text.getAttribute('font-weight') ?? '';
  if (!(weight in WEIGHTS)) return [];
  const fonts = [`Inter-${WEIGHTS[weight]}.otf ${weight} Inter`];
  if (JAPANESE.test(text.textContent ?? '')) fonts.push(`MPLUS1p-${JAPANESE_WEIGHTS[weight]}.ttf ${weight} "M PLUS 1p"`);
  return fonts;
}

/** Returns the CSS rule that embeds a font for systems where it isn't installed; cached. */
async function fontFace(font: string): Promise<string> {
  if (!fontFaces.has(font)) {
    const [file, weight, ...family] = font.split(' ');
    const read = readFace(file!, weight!, family.join(' '));
    read.catch(() => fontFaces.delete(font));  // retry for the next picture
    fontFaces.set(font, read);
  }
  return fontFaces.get(font)!;
}

async function readFace(file: string, weight: string, family: string): Promise<string> {
  const response = await fetch(`fonts/${file}`);
  const data = await new Promise<string>((resolve, failed) => {
    const reader = new FileReader();
    reader.onload = () => resolve(String(reader.result));
    reader.onerror = () => failed(reader.error ?? new Error('a font cannot be read'));
    void response.blob().then((blob) => reader.readAsDataURL(blob), failed);
  });
  return `@font-face { font-family: ${family}; font-weight: ${weight}; src: url(${data}); }`;
}
