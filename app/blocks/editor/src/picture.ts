// A picture of all blocks of a behaviour, also of those outside the view: SVG that needs nothing else (looks and fonts
// are in it), or PNG made of that. The canvas that is seen stays as it is; states of a run and outlines are left out.
import * as Blockly from 'blockly/core';
import {keepTyped, ownerOf} from './notes';

const SVG = 'http://www.w3.org/2000/svg';
/** Around the blocks; the signs at their left are 20 wide. */
const MARGIN = 32;
const SCALE = 2;
/** What is higher is the sheet of a note, not the bar above it. */
const HEAD = 30;
/** What Chromium can draw at once: on a side, and in all. */
const MOST_SIDE = 16_000;
const MOST_PIXELS = 120_000_000;

/** The looks that make a difference, with what they are where nobody says anything: that needs no words. */
const LOOKS: Readonly<Record<string, string>> = {
  'fill': 'rgb(0, 0, 0)', 'fill-opacity': '1', 'fill-rule': 'nonzero', 'stroke': 'none', 'stroke-width': '1px', 'stroke-opacity': '1',
  'stroke-linecap': 'butt', 'stroke-linejoin': 'miter', 'stroke-dasharray': 'none', 'opacity': '1', 'paint-order': 'normal',
};
const LETTERS: readonly string[] = ['font-family', 'font-size', 'font-weight', 'text-anchor', 'dominant-baseline'];
const SHAPES: readonly string[] = ['d', 'x', 'y', 'width', 'height', 'rx', 'ry', 'cx', 'cy', 'r', 'x1', 'y1', 'x2', 'y2', 'points',
  'transform', 'href', 'viewBox', 'dy', 'dx'];
const LEFT_OUT = '.nepState, .nepSelection, .nepTryHandle, .nepNoteButton, .blocklyInsertionMarker, .blocklyHighlightedConnectionPath, ' +
  '.blocklyResizeHandle, .blocklyFoldoutIcon, .blocklyDeleteIcon, .blocklyConnectionIndicator, title';

export interface Picture {
  svg: string;
  width: number;
  height: number;
}

/** What is on the canvas: a stack, a note, or the note of a block, which goes with its stack. */
export interface Drawn {
  item: unknown;
  box: Blockly.utils.Rect;
  drawn: SVGElement | null;
}

/** Each thing on the canvas, or `only` these, with its looks written on it; `patterns` gets what they are filled with, by id. */
export function drawings(workspace: Blockly.WorkspaceSvg, patterns: Map<string, SVGElement>, only?: ReadonlySet<unknown>): Drawn[] {
  keepTyped();
  Blockly.renderManagement.triggerQueuedRenders();
  const all = [...workspace.getTopBlocks(true), ...workspace.getTopComments()] as (Blockly.IBoundedElement & {
    getSvgRoot?(): SVGElement; view?: {getSvgRoot(): SVGElement};
  })[];
  const items = all.filter((each) => !only || only.has(each));
  const found = items.map((item): Drawn => ({item, box: item.getBoundingRectangle(),
    drawn: copy(item.getSvgRoot?.() ?? item.view!.getSvgRoot(), patterns)}));
  for (const sheet of workspace.getBubbleCanvas().querySelectorAll<SVGGElement>('.nepNote')) {
    const owner = workspace.getBlockById(ownerOf(sheet))?.getRootBlock();
    if (only && !only.has(owner)) continue;
    const {x, y, width, height} = sheet.getBBox();
    const {e, f} = sheet.transform.baseVal.consolidate()?.matrix ?? {e: 0, f: 0};
    found.push({item: owner,
      box: new Blockly.utils.Rect(y + f, y + f + height, x + e, x + e + width), drawn: copy(sheet, patterns)});
  }
  return found;
}

/** null: there is nothing to be seen. Call it while the page has the light theme; of `only` these, in the theme of now. */
export async function pictureOf(workspace: Blockly.WorkspaceSvg, white: boolean, only?: ReadonlySet<unknown>): Promise<Picture | null> {
  const patterns = new Map<string, SVGElement>();
  const found = drawings(workspace, patterns, only);
  if (!found.length) return null;
  const boxes = found.map(({box}) => box);
  const drawn = found.map((each) => each.drawn);
  for (const each of drawn) if (each) cut(each);
  const left = Math.floor(Math.min(...boxes.map((box) => box.left)) - MARGIN);
  const top = Math.floor(Math.min(...boxes.map((box) => box.top)) - MARGIN);
  const width = Math.ceil(Math.max(...boxes.map((box) => box.right)) + MARGIN) - left;
  const height = Math.ceil(Math.max(...boxes.map((box) => box.bottom)) + MARGIN) - top;
  const made = document.createElementNS(SVG, 'svg');
  for (const [name, value] of Object.entries({width, height, viewBox: `${left} ${top} ${width} ${height}`})) made.setAttribute(name, `${value}`);
  const looks = document.createElementNS(SVG, 'style');
  const fonts = new Set(drawn.flatMap((each) => [...each?.querySelectorAll('text') ?? []].flatMap(fontsOf)));
  const defs = document.createElementNS(SVG, 'defs');
  defs.append(...patterns.values());
  made.append(looks, defs);
  if (white) {
    const ground = document.createElementNS(SVG, 'rect');
    for (const [name, value] of Object.entries({x: left, y: top, width, height, fill: '#ffffff'})) ground.setAttribute(name, `${value}`);
    made.append(ground);
  }
  made.append(...drawn.filter((each) => each !== null));
  looks.textContent = (await Promise.all([...fonts].map(fontFace))).join('\n');
  return {svg: new XMLSerializer().serializeToString(made), width, height};
}

/** As a `data:` URL of a PNG, twice as large as on the screen (or `wanted`) or as large as can be. */
export async function asPng({svg, width, height}: Picture, wanted = SCALE): Promise<string> {
  const scale = Math.min(wanted, MOST_SIDE / width, MOST_SIDE / height, Math.sqrt(MOST_PIXELS / (width * height)));
  const image = new Image(width, height);
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
  canvas.getContext('2d')!.drawImage(image, 0, 0, canvas.width, canvas.height);
  return canvas.toDataURL('image/png');
}

/** The same shapes with their looks written on them; null for what is not seen. */
function copy(source: Element, patterns: Map<string, SVGElement>): SVGElement | null {
  if (source.matches(LEFT_OUT)) return null;
  const style = getComputedStyle(source);
  if (style.display === 'none' || style.visibility === 'hidden' || style.opacity === '0') return null;
  if (source.localName === 'foreignObject') return wordsOf(source);
  const made = document.createElementNS(SVG, source.localName);
  for (const name of SHAPES) {
    const value = source.getAttribute(name);
    if (value !== null) made.setAttribute(name, value);
  }
  if (source instanceof SVGGElement) {
    if (style.opacity !== '1') made.setAttribute('opacity', style.opacity);
  } else writeLooks(source, style, made, patterns);
  for (const child of source.childNodes) {
    if (child instanceof Element) {
      const inner = copy(child, patterns);
      if (inner) made.append(inner);
    } else if (child instanceof Text && (source.localName === 'text' || source.localName === 'tspan')) {
      made.append(child.data);
    }
  }
  return made;
}

function writeLooks(source: Element, style: CSSStyleDeclaration, made: SVGElement, patterns: Map<string, SVGElement>): void {
  for (const [name, usual] of Object.entries(LOOKS)) {
    const value = style.getPropertyValue(name);
    if (value && value !== usual) made.setAttribute(name, value);
  }
  if (source.localName === 'text') for (const name of LETTERS) made.setAttribute(name, style.getPropertyValue(name));
  const id = /url\("?#([^")]+)"?\)/.exec(style.fill)?.[1];
  if (!id) return;
  made.setAttribute('fill', `url(#${id})`);
  const pattern = document.getElementById(id);
  if (!pattern || patterns.has(id)) return;
  const kept = pattern.cloneNode(true) as SVGElement;
  [...pattern.querySelectorAll('*')].forEach((each, at) => {
    const looks = getComputedStyle(each);
    const mine = kept.querySelectorAll('*')[at];
    for (const name of ['fill', 'stroke']) mine?.setAttribute(name, looks.getPropertyValue(name));
  });
  patterns.set(id, kept);
}

/** The words of a note as lines of text: other programs show no fields of a page. */
function wordsOf(source: Element): SVGElement | null {
  const area = source.querySelector('textarea');
  if (!area?.value) return null;
  const style = getComputedStyle(area);
  const size = parseFloat(style.fontSize);
  const [x, y] = ['x', 'y'].map((name) => parseFloat(source.getAttribute(name) ?? '0') || 0) as [number, number];
  const [width, height] = ['width', 'height'].map((name) => parseFloat(source.getAttribute(name) ?? '0') || 0) as [number, number];
  const inset = parseFloat(style.paddingLeft) || 8;
  const rise = parseFloat(style.paddingTop) || 0;
  const each = parseFloat(style.lineHeight) || size * 1.4;
  const made = document.createElementNS(SVG, 'text');
  for (const name of ['font-family', 'font-size', 'font-weight'] as const) made.setAttribute(name, style.getPropertyValue(name));
  made.setAttribute('fill', style.color);
  const lines = wrapped(area.value, width - 2 * inset, `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`);
  const room = Math.max(1, Math.floor((height - rise) / each));
  lines.forEach((line, at) => {
    const part = document.createElementNS(SVG, 'tspan');
    part.setAttribute('x', `${x + inset}`);
    part.setAttribute('y', `${y + rise + size + at * each}`);
    part.textContent = line;
    made.append(part);
  });
  if (lines.length > room) Object.assign(made.dataset, {room, more: Math.ceil((lines.length - room) * each)});
  return made;
}

/** How much higher a note has to be for all its words. */
export function moreOf(note: SVGElement): number {
  return Number(note.querySelector<SVGElement>('[data-more]')?.dataset['more'] ?? 0);
}

/** Makes a note as high as its words. */
export function grow(note: SVGElement): void {
  const more = moreOf(note);
  for (const ground of note.querySelectorAll('rect')) {
    const height = Number(ground.getAttribute('height'));
    if (height > HEAD) ground.setAttribute('height', `${height + more}`);
  }
}

/** Leaves out the words that do not fit into a note, and says so with “…”. */
export function cut(note: SVGElement): void {
  const words = note.querySelector<SVGElement>('[data-room]');
  if (!words) return;
  const lines = [...words.children];
  const room = Number(words.dataset['room']);
  for (const line of lines.splice(room)) line.remove();
  lines[room - 1]?.append(' …');
}

function wrapped(words: string, width: number, font: string): string[] {
  const pen = document.createElement('canvas').getContext('2d')!;
  pen.font = font;
  const lines: string[] = [];
  for (const paragraph of words.split('\n')) {
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
/** A word with the spaces after it, or a single Japanese character: lines may break after each. */
const WORDS = /[\u3000-\u30ff\u3400-\u9fff\uff00-\uffef] *|[^ \u3000-\u30ff\u3400-\u9fff\uff00-\uffef]+ *| +/g;

const faces = new Map<string, Promise<string>>();

/** The bundled fonts of a text, as "file weight family". */
function fontsOf(text: SVGTextElement): string[] {
  const weight = text.getAttribute('font-weight') ?? '';
  if (!(weight in WEIGHTS)) return [];
  const found = [`Inter-${WEIGHTS[weight]}.otf ${weight} Inter`];
  if (JAPANESE.test(text.textContent ?? '')) found.push(`MPLUS1p-${JAPANESE_WEIGHTS[weight]}.ttf ${weight} "M PLUS 1p"`);
  return found;
}

/** Returns the rule that embeds a font, so that the picture looks the same where the font isn't installed; cached. */
async function fontFace(font: string): Promise<string> {
  if (!faces.has(font)) {
    const [file, weight, ...family] = font.split(' ');
    const read = readFace(file!, weight!, family.join(' '));
    read.catch(() => faces.delete(font));  // the next picture tries again
    faces.set(font, read);
  }
  return faces.get(font)!;
}

async function readFace(file: string, weight: string, family: string): Promise<string> {
  const answer = await fetch(`fonts/${file}`);
  const data = await new Promise<string>((done, failed) => {
    const reader = new FileReader();
    reader.onload = () => done(String(reader.result));
    reader.onerror = () => failed(reader.error ?? new Error('a font cannot be read'));
    void answer.blob().then((blob) => reader.readAsDataURL(blob), failed);
  });
  return `@font-face { font-family: ${family}; font-weight: ${weight}; src: url(${data}); }`;
}
