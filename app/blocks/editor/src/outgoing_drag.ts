// Blocks or a note that are dragged out of the page, which return to their place unless the window moves them.
import * as Blockly from 'blockly/core';
import {removeAll} from './carry';
import {type CopiedItem, type CopiedBlocks, copyOfAll, stateOf} from './clipboard';
import type {Note} from './selection';

type Point = Blockly.utils.Coordinate;

/** Items dragged out of the page. Dropped outside, they return to their original place. */
export interface OutgoingDrag {
  copied: CopiedItem | CopiedBlocks;
  /** Transfer to the other behaviour; blocks from the toolbox are `added`. */
  how: 'moved' | 'copied' | 'added';
  /** Top blocks of the dragged stacks; empty for a note. */
  heads: Blockly.BlockSvg[];
  place: Point;
  /** Offset of the mouse from the corner of the first item, in workspace units. */
  grip: Point;
  isGone(): boolean;
  /** Deletes the originals; the stack around them closes. */
  remove(): void;
}

export function isOutsideViewport({x, y}: Point): boolean {
  return x < 0 || y < 0 || x >= window.innerWidth || y >= window.innerHeight;
}

/** Returns the drag of an item out of the page, or null if the item can't leave the page. */
export function createOutgoingDrag(item: unknown, isFromToolbox: boolean, isCopy: boolean, mouse: Point): OutgoingDrag | null {
  const isOne = item instanceof Blockly.BlockSvg || item instanceof Blockly.comments.RenderedWorkspaceComment;
  const copied = isOne ? stateOf(item, true) : null;
  if (!isOne || !copied) return null;
  const block = item instanceof Blockly.BlockSvg ? item : null;
  const isAlone = !block?.getNextBlock();
  return {
    copied,
    how: isFromToolbox ? 'added' : isCopy || !item.isDeletable() ? 'copied' : 'moved',
    heads: block ? [block] : [],
    place: item.getRelativeToSurfaceXY(),
    grip: Blockly.utils.Coordinate.difference(mouse, item.getRelativeToSurfaceXY()),
    isGone: () => item.isDeadOrDying(),
    remove: () => block ? block.dispose(isAlone, false) : item.dispose(),
  };
}

/** Returns the drag of selected blocks and notes out of the page. */
export function createOutgoingGroupDrag(runs: readonly Blockly.BlockSvg[][], notes: readonly Note[], isCopy: boolean, mouse: Point): OutgoingDrag | null {
  const heads = runs.flatMap(([head]) => head ?? []);
  const first = heads[0] ?? notes[0];
  if (!first) return null;
  const all = [...runs.flat(), ...notes];
  return {
    copied: copyOfAll(runs, notes),
    how: isCopy || !all.every((item) => item.isDeletable()) ? 'copied' : 'moved',
    heads,
    place: first.getRelativeToSurfaceXY(),
    grip: Blockly.utils.Coordinate.difference(mouse, first.getRelativeToSurfaceXY()),
    isGone: () => all.some((item) => item.isDeadOrDying()),
    remove: () => removeAll(runs, notes),
  };
}
