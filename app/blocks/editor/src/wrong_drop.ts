// Explains why a dropped block doesn't fit, with a hint at that place, and moves the block aside.
import * as Blockly from 'blockly/core';
import {findFreePosition, visibleArea, obstacles} from './free_place';
import {helpFor} from './help';
import {Hint} from './hint';
import {lazy, t} from './words';

/** Maximum distance between a drop and the slot that it targets, in screen pixels. */
const MAX_DISTANCE_PX = 30;
const OFFSET = 28;
const EMPTY_INPUT_SIZE = 40;

const TYPE_LABELS: Readonly<Record<string, string>> = {
  Number: lazy('a number'),
  String: lazy('a text'),
  Boolean: lazy('yes or no'),
  List: lazy('a list'),
};

const OTHER_TYPE_LABEL = lazy('another value');

interface DropRejection {
  /** Block that rejected the drop. */
  by: Blockly.BlockSvg;
  sentence: string;
  /** Position of the rejecting connection, in workspace coordinates. */
  place: Blockly.utils.Coordinate;
}

export class RejectedDrops {
  private readonly hint: Hint;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    this.hint = new Hint(workspace);
  }

  dispose(): void {
    this.hint.dispose();
  }

  /** Shows why the block did not connect, if it was dropped near a connection, and moves it aside if needed. */
  explainDrop(block: Blockly.BlockSvg, mouse: Blockly.utils.Coordinate): void {
    this.showRejection(block, this.findRejection(block, Blockly.utils.svgMath.screenToWsCoordinates(this.workspace, mouse)));
  }

  /** Same for a value placed with the keyboard; `target` is the slot, field or block that had the focus before. */
  explainKeyboardDrop(block: Blockly.BlockSvg, target: Blockly.IFocusableNode): void {
    if (block.outputConnection) this.showRejection(block, rejectionAt(block, target));
  }

  private showRejection(block: Blockly.BlockSvg, rejection: DropRejection | null): void {
    if (!rejection) return;
    const position = Blockly.utils.svgMath.wsToScreenCoordinates(this.workspace, rejection.place);
    this.hint.show(rejection.sentence, position);
    this.moveAside(block, rejection.by);
  }

  private moveAside(block: Blockly.BlockSvg, by: Blockly.BlockSvg): void {
    const mine = block.getBoundingRectangle();
    const otherBounds = by.getBoundingRectangleWithoutChildren();
    const inputs = by.getHeightWidth();
    const right = Math.max(otherBounds.right, by.getRelativeToSurfaceXY().x + inputs.width);
    otherBounds.right = right;
    const hintBounds = this.hint.bounds;
    const corner = (x: number, y: number) =>
      Blockly.utils.svgMath.screenToWsCoordinates(this.workspace, new Blockly.utils.Coordinate(x, y));
    const [from, to] = [corner(hintBounds.left, hintBounds.top), corner(hintBounds.right, hintBounds.bottom)];
    const bubble = new Blockly.utils.Rect(from.y, to.y, from.x, to.x);
    if (mine.intersects(otherBounds)) shift(block, right + OFFSET - mine.left, mine);
    if (mine.intersects(bubble)) shift(block, bubble.right + OFFSET - mine.left, mine);
    this.moveToFreePosition(block, mine, bubble);
  }

  /** Moves the block to the next free position if it overlaps another script. */
  private moveToFreePosition(block: Blockly.BlockSvg, mine: Blockly.utils.Rect, bubble: Blockly.utils.Rect): void {
    const others = obstacles(this.workspace, new Set([block]));
    if (!others.some((other) => other.intersects(mine))) return;
    const requested = new Blockly.utils.Coordinate(mine.left, mine.top);
    const size = {width: mine.getWidth(), height: mine.getHeight()};
    const position = findFreePosition(requested, size, [...others, bubble], visibleArea(this.workspace), OFFSET);
    block.moveBy(position.x - mine.left, position.y - mine.top, ['bump']);
  }

  private findRejection(block: Blockly.BlockSvg, mouse: Blockly.utils.Coordinate): DropRejection | null {
    const ownBlocks = new Set(block.getDescendants(false));
    const maxDistance = MAX_DISTANCE_PX / this.workspace.scale;
    let best: DropRejection | null = null;
    let nearest = Infinity;
    const consider = (distance: number, make: () => DropRejection | null) => {
      if (distance >= nearest) return;
      const candidate = make();
      if (candidate) [best, nearest] = [candidate, distance];
    };
    const corner = block.getRelativeToSurfaceXY();
    for (const other of this.workspace.getAllBlocks(false)) {
      if (ownBlocks.has(other) || other.isShadow() || other.isInsertionMarker() || other.isCollapsed()) continue;
      for (const input of other.inputList) {
        const gap = input.connection as Blockly.RenderedConnection | null;
        if (!gap || !input.isVisible()) continue;
        const distance = Math.min(distanceBetween(corner, gap), isInInput(gap, mouse) ? 0 : Infinity);
        if (distance < maxDistance) consider(distance, () => rejectionAtInput(block, other, gap));
      }
      const end = nextBlockPosition(other);
      if (end && distanceBetween(corner, end) < maxDistance) consider(distanceBetween(corner, end), () => rejectionBelow(block, other, end));
    }
    return best;
  }
}

/** Returns why a value doesn't fit at the focused target. */
function rejectionAt(block: Blockly.BlockSvg, target: Blockly.IFocusableNode): DropRejection | null {
  if (target instanceof Blockly.RenderedConnection) return rejectionAtInput(block, target.getSourceBlock(), target);
  const targetBlock = target instanceof Blockly.Field ? target.getSourceBlock() : target;
  if (!(targetBlock instanceof Blockly.BlockSvg)) return null;
  if (targetBlock.isShadow() && targetBlock.outputConnection?.targetConnection) {
    const gap: Blockly.RenderedConnection = targetBlock.outputConnection.targetConnection;
    return rejectionAtInput(block, gap.getSourceBlock(), gap);
  }
  const gaps = targetBlock.inputList.map((input) => input.connection as Blockly.RenderedConnection | null)
    .filter((gap): gap is Blockly.RenderedConnection => gap?.type === Blockly.ConnectionType.INPUT_VALUE);
  for (const gap of gaps) {
    const rejection = rejectionAtInput(block, targetBlock, gap);
    if (rejection) return rejection;
  }
  const end = nextBlockPosition(targetBlock);
  return end && rejectionBelow(block, targetBlock, end);
}

function shift(block: Blockly.BlockSvg, by: number, box: Blockly.utils.Rect): void {
  block.moveBy(by, 0, ['bump']);
  box.left += by;
  box.right += by;
}

function distanceBetween(point: {x: number; y: number}, other: {x: number; y: number}): number {
  return Math.hypot(point.x - other.x, point.y - other.y);
}

/** Returns the position at which a next block would start. */
function nextBlockPosition(block: Blockly.BlockSvg): Blockly.utils.Coordinate | null {
  if (block.outputConnection) return null;
  const {x, y} = block.getRelativeToSurfaceXY();
  const {nextConnection} = block;
  if (nextConnection) return new Blockly.utils.Coordinate(nextConnection.x, nextConnection.y);
  return new Blockly.utils.Coordinate(x, y + block.getHeightWidth().height);
}

/** Returns true if the pointer is over a free value slot. */
function isInInput(gap: Blockly.RenderedConnection, mouse: Blockly.utils.Coordinate): boolean {
  if (gap.type !== Blockly.ConnectionType.INPUT_VALUE) return false;
  const targetBlock = gap.targetBlock();
  if (targetBlock && !targetBlock.isShadow()) return false;
  const size = targetBlock?.getHeightWidth() ?? {width: EMPTY_INPUT_SIZE, height: EMPTY_INPUT_SIZE};
  return mouse.x > gap.x && mouse.x < gap.x + size.width && mouse.y > gap.y - 4 && mouse.y < gap.y + size.height;
}

function rejectionAtInput(block: Blockly.BlockSvg, other: Blockly.BlockSvg, gap: Blockly.RenderedConnection): DropRejection | null {
  const place = new Blockly.utils.Coordinate(gap.x, gap.y);
  const name = blockName(block);
  if (gap.type === Blockly.ConnectionType.NEXT_STATEMENT) {
    return block.outputConnection ? {by: other, place, sentence: valueMessage(name)} : null;
  }
  if (!block.outputConnection) {
    return {by: other, place, sentence: t('“{block}” doesn\'t return a value, so it doesn\'t fit into a value slot. Place it below another block.', {block: name})};
  }
  const check = gap.getCheck();
  const gives = block.outputConnection.getCheck();
  if (!check || !gives || check.some((type) => gives.includes(type))) return null;
  const kind = check[0] ?? '';
  const expected = t(TYPE_LABELS[kind] ?? OTHER_TYPE_LABEL);
  const owner = helpFor(other.type)?.name;
  const sentence = owner ? t('“{block}” needs {what} here', {block: owner, what: expected}) : t('This slot needs {what}', {what: expected});
  return {by: other, place, sentence};
}

function rejectionBelow(block: Blockly.BlockSvg, other: Blockly.BlockSvg, place: Blockly.utils.Coordinate): DropRejection | null {
  const name = blockName(block);
  if (block.outputConnection) return {by: other, place, sentence: valueMessage(name)};
  if (!block.previousConnection) {
    return {by: other, place, sentence: t('“{block}” starts a script, so no block can be above it', {block: name})};
  }
  if (!other.nextConnection) return {by: other, place, sentence: t('“{block}” can\'t have blocks below it', {block: blockName(other)})};
  if (block.nextConnection || !other.getNextBlock()) return null;
  return {by: other, place, sentence: t('“{block}” can\'t have blocks below it. Place it at the end.', {block: name})};
}

function valueMessage(name: string): string {
  return t('“{block}” is a value. Drag it into a slot of another block.', {block: name});
}

function blockName(block: Blockly.BlockSvg): string {
  return helpFor(block.type)?.name || t('this block');
}
