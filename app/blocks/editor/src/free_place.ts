// A place on the canvas where something new lies free: near where it is wanted, on nothing else, in sight.
import * as Blockly from 'blockly/core';

const {Rect, Coordinate} = Blockly.utils;
type Box = Blockly.utils.Rect;
type Point = Blockly.utils.Coordinate;

/** Between what is new and what is there: more than Blockly's reach of a connection, so that nothing seems to hang on it. */
const GAP = 34;
const STEP = 28;
const FAR = 60;

/** What is on the canvas, in its units: whole stacks and notes. */
export function obstacles(workspace: Blockly.WorkspaceSvg, but: ReadonlySet<unknown>): Box[] {
  return [...workspace.getTopBlocks(false), ...workspace.getTopComments()]
    .filter((each) => !but.has(each))
    .map((each) => (each as Blockly.IBoundedElement).getBoundingRectangle());
}

/** The part of the canvas that can be seen, in its units; what the open toolbox covers cannot. */
export function inSight(workspace: Blockly.WorkspaceSvg): Box {
  const {left, top, width, height} = workspace.getMetricsManager().getViewMetrics(true);
  const margin = 12 / workspace.scale;
  return new Rect(top + margin, top + height - margin, left + margin, left + width - margin);
}

function overlaps(a: Box, b: Box, gap: number): boolean {
  return a.left < b.right + gap && b.left < a.right + gap && a.top < b.bottom + gap && b.top < a.bottom + gap;
}

function at(place: Point, width: number, height: number): Box {
  return new Rect(place.y, place.y + height, place.x, place.x + width);
}

/** Whether it can be seen as far as its size allows: a tall stack at least with its beginning. */
function isSeen(box: Box, view: Box): boolean {
  const across = Math.min(box.getWidth(), view.getWidth());
  const down = Math.min(box.getHeight(), view.getHeight() / 2);
  return box.left >= view.left && box.left + across <= view.right && box.top >= view.top && box.top + down <= view.bottom;
}

/** Rings of places around the one that is wanted, the nearest first. */
function* around(wanted: Point): Generator<Point> {
  yield wanted;
  for (let ring = 1; ring <= FAR; ring += 1) {
    for (let side = -ring; side <= ring; side += 1) {
      const [far, near] = [ring * STEP, side * STEP];
      yield new Coordinate(wanted.x + far, wanted.y + near);
      yield new Coordinate(wanted.x + near, wanted.y + far);
      yield new Coordinate(wanted.x + near, wanted.y - far);
      yield new Coordinate(wanted.x - far, wanted.y + near);
    }
  }
}

/** The free place nearest to `wanted` that can be seen; when all that can be seen is full, the nearest free one. */
export function freePlace(wanted: Point, size: {width: number; height: number}, others: Box[], view: Box,
  gap = GAP): Point {
  let hidden: Point | null = null;
  for (const place of around(wanted)) {
    const box = at(place, size.width, size.height);
    const seen = isSeen(box, view);
    if ((!seen && hidden) || others.some((other) => overlaps(box, other, gap))) continue;
    if (seen) return place;
    hidden ??= place;
  }
  return hidden ?? wanted;
}
