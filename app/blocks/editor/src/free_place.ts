// A place on the canvas where something new lies free: near where it is wanted, on nothing else, in sight.
import * as Blockly from 'blockly/core';

const {Rect, Coordinate} = Blockly.utils;
type Box = Blockly.utils.Rect;
type Point = Blockly.utils.Coordinate;

/** Between what is new and what is there: more than Blockly's reach of a connection, so that nothing seems to hang on it. */
const GAP = 34;
const STEP = 28;
const MAX_RINGS = 60;

/** What is on the canvas, in its units: whole stacks and notes. */
export function obstacles(workspace: Blockly.WorkspaceSvg, but: ReadonlySet<unknown>): Box[] {
  return [...workspace.getTopBlocks(false), ...workspace.getTopComments()]
    .filter((item) => !but.has(item))
    .map((item) => (item as Blockly.IBoundedElement).getBoundingRectangle());
}

/** The part of the canvas that can be seen, in its units; what the open toolbox covers cannot. */
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

/** Whether it can be seen as far as its size allows: a tall stack at least with its beginning. */
function isVisibleIn(box: Box, view: Box): boolean {
  const requiredWidth = Math.min(box.getWidth(), view.getWidth());
  const requiredHeight = Math.min(box.getHeight(), view.getHeight() / 2);
  return box.left >= view.left && box.left + requiredWidth <= view.right && box.top >= view.top && box.top + requiredHeight <= view.bottom;
}

/** Rings of places around the one that is wanted, the nearest first. */
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

/** The free place nearest to `wanted` that can be seen; when all that can be seen is full, the nearest free one. */
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
