// Search for free positions for new blocks and notes, and separation of scripts that overlap because their
// translated texts are longer.
import * as Blockly from 'blockly/core';

const {Rect, Coordinate} = Blockly.utils;
type Box = Blockly.utils.Rect;
type Point = Blockly.utils.Coordinate;

/** Gap to existing items; larger than Blockly's snap radius, so that nothing looks connected. */
const GAP = 34;
/** Minimum gap between scripts that `separateColumns` moves. */
const COLUMN_GAP = 20;
const STEP = 28;
const MAX_RINGS = 60;

/** Returns the bounds of all stacks and notes except `excluded`, in workspace units. */
export function obstacles(workspace: Blockly.WorkspaceSvg, excluded: ReadonlySet<unknown>): Box[] {
  return [...workspace.getTopBlocks(false), ...workspace.getTopComments()]
    .filter((item) => !excluded.has(item))
    .map((item) => (item as Blockly.IBoundedElement).getBoundingRectangle());
}

/** Returns the visible part of the canvas, which excludes the toolbox, in workspace units. */
export function visibleArea(workspace: Blockly.WorkspaceSvg): Box {
  const {left, top, width, height} = workspace.getMetricsManager().getViewMetrics(true);
  const margin = 12 / workspace.scale;
  return new Rect(top + margin, top + height - margin, left + margin, left + width - margin);
}

function overlaps(a: Box, b: Box, gap: number): boolean {
  return a.left < b.right + gap && b.left < a.right + gap && a.top < b.bottom + gap && b.top < a.bottom + gap;
}

function rectAt(position: Point, width: number, height: number): Box {
  return new Rect(position.y, position.y + height, position.x, position.x + width);
}

/** Returns true if the box is in view as far as its size allows; of a tall stack, the top is enough. */
function isVisibleIn(box: Box, view: Box): boolean {
  const requiredWidth = Math.min(box.getWidth(), view.getWidth());
  const requiredHeight = Math.min(box.getHeight(), view.getHeight() / 2);
  return box.left >= view.left && box.left + requiredWidth <= view.right && box.top >= view.top && box.top + requiredHeight <= view.bottom;
}

/** Yields rings of positions around the center, nearest first. */
function* positionsAround(center: Point): Generator<Point> {
  yield center;
  for (let ring = 1; ring <= MAX_RINGS; ring += 1) {
    for (let side = -ring; side <= ring; side += 1) {
      const [far, near] = [ring * STEP, side * STEP];
      yield new Coordinate(center.x + far, center.y + near);
      yield new Coordinate(center.x + near, center.y + far);
      yield new Coordinate(center.x + near, center.y - far);
      yield new Coordinate(center.x - far, center.y + near);
    }
  }
}

/** Returns the free visible position nearest to `target`, or the nearest free one if the whole view is full. */
export function findFreePosition(target: Point, size: {width: number; height: number}, others: Box[], view: Box,
  gap = GAP): Point {
  let hidden: Point | null = null;
  for (const position of positionsAround(target)) {
    const box = rectAt(position, size.width, size.height);
    const isVisible = isVisibleIn(box, view);
    if ((!isVisible && hidden) || others.some((other) => overlaps(box, other, gap))) continue;
    if (isVisible) return position;
    hidden ??= position;
  }
  return hidden ?? target;
}

/**
 * Moves columns of scripts and notes to the right, and the items of a column down, until no two items overlap.
 *
 * The items with the same left edge form a column; they still have a common left edge afterwards, and the order of
 * the columns and of their items doesn't change. Items that are moved get a gap of at least `COLUMN_GAP`.
 */
export function separateColumns(workspace: Blockly.WorkspaceSvg): void {
  Blockly.renderManagement.triggerQueuedRenders(workspace);
  const items = [...workspace.getTopBlocks(false), ...workspace.getTopComments()] as Blockly.IBoundedElement[];
  const columns = new Map<number, {item: Blockly.IBoundedElement; box: Box}[]>();
  for (const item of items) {
    const box = item.getBoundingRectangle();
    const left = Math.round((item as Blockly.BlockSvg).getRelativeToSurfaceXY().x);
    columns.set(left, [...columns.get(left) ?? [], {item, box}]);
  }
  const placedBoxes: Box[] = [];
  let shiftX = 0;
  for (const left of [...columns.keys()].sort((a, b) => a - b)) {
    const column = columns.get(left)!.sort((a, b) => a.box.top - b.box.top);
    let bottom = -Infinity;
    for (const entry of column) {
      const shiftY = Math.max(0, bottom - entry.box.top);
      entry.item.moveBy(0, shiftY);
      entry.box = rectAt(new Coordinate(entry.box.left, entry.box.top + shiftY), entry.box.getWidth(), entry.box.getHeight());
      bottom = entry.box.bottom + COLUMN_GAP;
    }
    for (const {box} of column) {
      for (const other of placedBoxes) {
        const isBeside = box.top < other.bottom && other.top < box.bottom;
        if (isBeside) shiftX = Math.max(shiftX, other.right + COLUMN_GAP - box.left);
      }
    }
    for (const {item, box} of column) {
      item.moveBy(shiftX, 0);
      placedBoxes.push(rectAt(new Coordinate(box.left + shiftX, box.top), box.getWidth(), box.getHeight()));
    }
  }
}
