// Print layout of the blocks: stacks in reading order and in columns, split between two blocks if they don't
// fit on a page. The pages are part of the editor's page and visible to the printer only.
import * as Blockly from 'blockly/core';
import type {LayOutPages} from './messages';
import {truncateNote, renderItems, expandNote, overflowHeight} from './picture';
import {t} from './words';

const SVG_NS = 'http://www.w3.org/2000/svg';
/** Scale of blocks on paper, which makes their text 9 points high. */
const SCALE = 0.8;
/** Margins around a stack, in workspace units; at the left are the icons of its notes. */
const LEFT_MARGIN = 24;
const MARGIN = 6;
/** Gap between stacks and height of a page's header, in pixels. */
const GAP = 20;
const HEADER_HEIGHT = 40;
/** Minimum free share of a column to start a stack that has to be split. */
const MIN_COLUMN_FRACTION = 0.4;
/** Tolerance for rounding errors. */
const ROUNDING_TOLERANCE = 0.01;

type Box = Blockly.utils.Rect;

/** Stack with its notes. */
interface Cluster {
  box: Box;
  drawn: SVGElement[];
  /** Positions at which the stack can be split: above each block that has one above it. */
  cuts: number[];
}

/** Part of a cluster on one page. */
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

/** Lays out the pages for the printer and returns their number; call with the light theme active. */
export function layoutPages(workspace: Blockly.WorkspaceSvg, setup: LayOutPages): number {
  clearPages();
  const patterns = new Map<string, SVGElement>();
  const clusters = clustersOf(workspace, patterns);
  if (!clusters.length) return 0;
  const pieces = layoutClusters(clusters, setup.width - 2 * setup.margin, setup.height - 2 * setup.margin - HEADER_HEIGHT);
  const count = Math.max(...pieces.map(({page}) => page)) + 1;
  pages = document.createElement('div');
  pages.className = 'nepPrint';
  pages.append(createSharedDefs(patterns));
  for (let page = 0; page < count; page += 1) {
    pages.append(createPage(setup, page, count, pieces.filter((piece) => piece.page === page)));
  }
  document.body.append(pages);
  return count;
}

export function clearPages(): void {
  pages?.remove();
  pages = null;
}

/** Returns the clusters in reading order: top to bottom, then left to right. */
function clustersOf(workspace: Blockly.WorkspaceSvg, patterns: Map<string, SVGElement>): Cluster[] {
  const clusters = new Map<unknown, Cluster>();
  for (const {item, box, drawn} of renderItems(workspace, patterns)) {
    if (!drawn) continue;
    const more = overflowHeight(drawn);
    const fullBox = new Blockly.utils.Rect(box.top, box.bottom + more, box.left, box.right);
    if (more && isFree(fullBox, box, item)) {
      expandNote(drawn);
      box.bottom = fullBox.bottom;
    } else truncateNote(drawn);
    const cluster = clusters.get(item);
    if (cluster) {
      cluster.box = union(cluster.box, box);
      cluster.drawn.push(drawn);
    } else clusters.set(item ?? drawn, {box, drawn: [drawn], cuts: item instanceof Blockly.BlockSvg ? cutsOf(item) : []});
  }
  return [...clusters.values()].sort((a, b) => a.box.top - b.box.top || a.box.left - b.box.left);
}

/** Returns true if a note can be extended without covering more blocks of its stack. */
function isFree(fullBox: Box, before: Box, item: unknown): boolean {
  if (!(item instanceof Blockly.BlockSvg)) return true;
  return item.getDescendants(false).map((block) => block.getBoundingRectangleWithoutChildren())
    .every((rect) => !rect.intersects(fullBox) || rect.intersects(before));
}

function union(a: Box, b: Box): Box {
  return new Blockly.utils.Rect(Math.min(a.top, b.top), Math.max(a.bottom, b.bottom), Math.min(a.left, b.left),
    Math.max(a.right, b.right));
}

function cutsOf(stack: Blockly.BlockSvg): number[] {
  return stack.getDescendants(true).filter((block) => block.previousConnection && !block.isShadow() && block !== stack)
    .map((block) => block.getRelativeToSurfaceXY().y).sort((a, b) => a - b);
}

/** Lays out the clusters in columns: downwards, then in the next column, then on the next page. */
function layoutClusters(clusters: readonly Cluster[], width: number, height: number): Piece[] {
  const pieces: Piece[] = [];
  let [page, x, y, column] = [0, 0, 0, 0];
  const next = (clusterWidth: number) => {
    [x, y, column] = [x + column + GAP, 0, 0];
    if (x + clusterWidth > width) [page, x] = [page + 1, 0];
  };
  for (const cluster of clusters) {
    const {box} = cluster;
    const scale = Math.min(SCALE, width / (box.getWidth() + LEFT_MARGIN + MARGIN));
    const clusterWidth = (box.getWidth() + LEFT_MARGIN + MARGIN) * scale;
    const clusterHeight = (box.getHeight() + 2 * MARGIN) * scale;
    const put = (from: number, to: number) => {
      pieces.push({cluster, page, x, y, scale, from, to});
      column = Math.max(column, clusterWidth);
      y += (to - from) * scale + GAP;
    };
    if (y > 0 && x + clusterWidth > width + ROUNDING_TOLERANCE) next(clusterWidth);
    if (y > 0 && y + clusterHeight > height && (clusterHeight <= height || height - y < height * MIN_COLUMN_FRACTION)) next(clusterWidth);
    let from = box.top - MARGIN;
    const end = box.bottom + MARGIN;
    while ((end - from) * scale > height - y + ROUNDING_TOLERANCE) {
      const last = from + (height - y) / scale;
      const cut = cluster.cuts.filter((position) => position > from + 1 && position <= last).pop() ?? last;
      put(from, cut);
      from = cut;
      next(clusterWidth);
    }
    put(from, end);
  }
  return pieces;
}

function createPage({title, date, width, height, margin}: LayOutPages, page: number, count: number, pieces: Piece[]): HTMLElement {
  const section = document.createElement('section');
  // Slightly smaller than the sheet, because rounding up would start another page.
  Object.assign(section.style, {width: `${width}px`, height: `${height - 1}px`, padding: `${margin}px`});
  const header = document.createElement('header');
  const [name, about] = [document.createElement('b'), document.createElement('span')];
  name.textContent = title;
  const pageLabel = t('Page {page} of {count}', {page: page + 1, count});
  about.textContent = `${date} · ${pageLabel}`;
  header.append(name, about);
  section.append(header);
  for (const piece of pieces) section.append(createPiece(piece, margin));
  return section;
}

function createPiece({cluster: {box, drawn}, x, y, scale, from, to}: Piece, margin: number): SVGElement {
  const svg = document.createElementNS(SVG_NS, 'svg');
  const [wide, high] = [box.getWidth() + LEFT_MARGIN + MARGIN, to - from];
  const attributes = {width: wide * scale, height: high * scale, viewBox: `${box.left - LEFT_MARGIN} ${from} ${wide} ${high}`};
  for (const [name, value] of Object.entries(attributes)) svg.setAttribute(name, `${value}`);
  Object.assign(svg.style, {left: `${margin + x}px`, top: `${margin + HEADER_HEIGHT + y}px`});
  for (const element of drawn) svg.append(prefixPatternIds(element.cloneNode(true) as SVGElement));
  return svg;
}

/** Prefix of pattern ids; the canvas, which isn't printed, uses the same ids without it. */
const ID_PREFIX = 'nepPrint-';

function prefixPatternIds(drawn: SVGElement): SVGElement {
  for (const element of [drawn, ...drawn.querySelectorAll('[fill^="url(#"]')]) {
    const fill = element.getAttribute('fill');
    if (fill?.startsWith('url(#')) element.setAttribute('fill', fill.replace('#', `#${ID_PREFIX}`));
  }
  return drawn;
}

function createSharedDefs(patterns: Map<string, SVGElement>): SVGElement {
  const svg = document.createElementNS(SVG_NS, 'svg');
  for (const side of ['width', 'height']) svg.setAttribute(side, '0');
  const defs = document.createElementNS(SVG_NS, 'defs');
  for (const [id, pattern] of patterns) {
    pattern.id = ID_PREFIX + id;
    defs.append(pattern);
  }
  svg.append(defs);
  return svg;
}
