// The program on paper: stacks in the order in which they are read, whole where they fit on a page, parted between two
// blocks where they do not; in columns, as a newspaper. The pages lie in the page of the editor, which shows them only to the printer.
import * as Blockly from 'blockly/core';
import {cut, drawings, grow, moreOf} from './picture';
import {t} from './words';

const SVG = 'http://www.w3.org/2000/svg';
/** Of blocks on paper: their words are 9 points high. */
const SCALE = 0.8;
/** Around a stack, in units of the canvas: at its left are the signs of its notes. */
const LEFT = 24;
const AROUND = 6;
/** Between stacks, and below the title of a page, in pixels. */
const GAP = 20;
const HEAD = 40;
/** So much of a column has to be free for the beginning of a stack that is parted anyway. */
const LEAST = 0.4;
/** What is lost by rounding. */
const SLACK = 0.01;

type Box = Blockly.utils.Rect;

export interface Wanted {
  title: string;
  date: string;
  /** Of a sheet and its empty edge, in pixels of a page: 96 in an inch. */
  width: number;
  height: number;
  edge: number;
}

/** A stack with its notes. */
interface Cluster {
  box: Box;
  drawn: SVGElement[];
  /** Where it can be parted: above each block that hangs below another. */
  cuts: number[];
}

/** A part of a cluster on a page. */
interface Piece {
  cluster: Cluster;
  page: number;
  x: number;
  y: number;
  scale: number;
  from: number;
  to: number;
}

let pages: HTMLElement | null = null;

/** Lays the pages ready for the printer; how many. Call it while the page has the light theme. */
export function layPages(workspace: Blockly.WorkspaceSvg, wanted: Wanted): number {
  clearPages();
  const patterns = new Map<string, SVGElement>();
  const clusters = clustersOf(workspace, patterns);
  if (!clusters.length) return 0;
  const pieces = place(clusters, wanted.width - 2 * wanted.edge, wanted.height - 2 * wanted.edge - HEAD);
  const count = Math.max(...pieces.map(({page}) => page)) + 1;
  pages = document.createElement('div');
  pages.className = 'nepPrint';
  pages.append(shared(patterns));
  for (let page = 0; page < count; page += 1) {
    pages.append(sheet(wanted, page, count, pieces.filter((each) => each.page === page)));
  }
  document.body.append(pages);
  return count;
}

export function clearPages(): void {
  pages?.remove();
  pages = null;
}

/** In the order in which they are read: from above, then from the left. */
function clustersOf(workspace: Blockly.WorkspaceSvg, patterns: Map<string, SVGElement>): Cluster[] {
  const clusters = new Map<unknown, Cluster>();
  for (const {item, box, drawn} of drawings(workspace, patterns)) {
    if (!drawn) continue;
    const more = moreOf(drawn);
    const whole = new Blockly.utils.Rect(box.top, box.bottom + more, box.left, box.right);
    if (more && isFree(whole, box, item)) {
      grow(drawn);
      box.bottom = whole.bottom;
    } else cut(drawn);
    const found = clusters.get(item);
    if (found) {
      found.box = around(found.box, box);
      found.drawn.push(drawn);
    } else clusters.set(item ?? drawn, {box, drawn: [drawn], cuts: item instanceof Blockly.BlockSvg ? cutsOf(item) : []});
  }
  return [...clusters.values()].sort((a, b) => a.box.top - b.box.top || a.box.left - b.box.left);
}

/** Whether a note may be so high: none of the blocks that it belongs to is below it. */
function isFree(whole: Box, before: Box, item: unknown): boolean {
  if (!(item instanceof Blockly.BlockSvg)) return true;
  return item.getDescendants(false).map((each) => each.getBoundingRectangleWithoutChildren())
    .every((each) => !each.intersects(whole) || each.intersects(before));
}

function around(a: Box, b: Box): Box {
  return new Blockly.utils.Rect(Math.min(a.top, b.top), Math.max(a.bottom, b.bottom), Math.min(a.left, b.left),
    Math.max(a.right, b.right));
}

function cutsOf(stack: Blockly.BlockSvg): number[] {
  return stack.getDescendants(true).filter((each) => each.previousConnection && !each.isShadow() && each !== stack)
    .map((each) => each.getRelativeToSurfaceXY().y).sort((a, b) => a - b);
}

/** In columns: below each other, then at the right of that, then on the next page. */
function place(clusters: readonly Cluster[], width: number, height: number): Piece[] {
  const pieces: Piece[] = [];
  let [page, x, y, column] = [0, 0, 0, 0];
  const next = (wide: number) => {
    [x, y, column] = [x + column + GAP, 0, 0];
    if (x + wide > width) [page, x] = [page + 1, 0];
  };
  for (const cluster of clusters) {
    const {box} = cluster;
    const scale = Math.min(SCALE, width / (box.getWidth() + LEFT + AROUND));
    const wide = (box.getWidth() + LEFT + AROUND) * scale;
    const high = (box.getHeight() + 2 * AROUND) * scale;
    const put = (from: number, to: number) => {
      pieces.push({cluster, page, x, y, scale, from, to});
      column = Math.max(column, wide);
      y += (to - from) * scale + GAP;
    };
    if (y > 0 && x + wide > width + SLACK) next(wide);
    if (y > 0 && y + high > height && (high <= height || height - y < height * LEAST)) next(wide);
    let from = box.top - AROUND;
    const end = box.bottom + AROUND;
    while ((end - from) * scale > height - y + SLACK) {
      const last = from + (height - y) / scale;
      const cut = cluster.cuts.filter((each) => each > from + 1 && each <= last).pop() ?? last;
      put(from, cut);
      from = cut;
      next(wide);
    }
    put(from, end);
  }
  return pieces;
}

function sheet({title, date, width, height, edge}: Wanted, page: number, count: number, pieces: Piece[]): HTMLElement {
  const made = document.createElement('section');
  // A little less than the sheet: what is rounded up would begin another one.
  Object.assign(made.style, {width: `${width}px`, height: `${height - 1}px`, padding: `${edge}px`});
  const head = document.createElement('header');
  const [name, about] = [document.createElement('b'), document.createElement('span')];
  name.textContent = title;
  const place = t('Page {page} of {count}', {page: page + 1, count});
  about.textContent = `${date} · ${place}`;
  head.append(name, about);
  made.append(head);
  for (const piece of pieces) made.append(drawnPiece(piece, edge));
  return made;
}

function drawnPiece({cluster: {box, drawn}, x, y, scale, from, to}: Piece, edge: number): SVGElement {
  const made = document.createElementNS(SVG, 'svg');
  const [wide, high] = [box.getWidth() + LEFT + AROUND, to - from];
  const looks = {width: wide * scale, height: high * scale, viewBox: `${box.left - LEFT} ${from} ${wide} ${high}`};
  for (const [name, value] of Object.entries(looks)) made.setAttribute(name, `${value}`);
  Object.assign(made.style, {left: `${edge + x}px`, top: `${edge + HEAD + y}px`});
  for (const each of drawn) made.append(ofPrint(each.cloneNode(true) as SVGElement));
  return made;
}

/** The canvas has patterns of the same names, and is not shown on paper. */
const NAME = 'nepPrint-';

function ofPrint(drawn: SVGElement): SVGElement {
  for (const each of [drawn, ...drawn.querySelectorAll('[fill^="url(#"]')]) {
    const fill = each.getAttribute('fill');
    if (fill?.startsWith('url(#')) each.setAttribute('fill', fill.replace('#', `#${NAME}`));
  }
  return drawn;
}

function shared(patterns: Map<string, SVGElement>): SVGElement {
  const made = document.createElementNS(SVG, 'svg');
  for (const side of ['width', 'height']) made.setAttribute(side, '0');
  const defs = document.createElementNS(SVG, 'defs');
  for (const [id, pattern] of patterns) {
    pattern.id = NAME + id;
    defs.append(pattern);
  }
  made.append(defs);
  return made;
}
