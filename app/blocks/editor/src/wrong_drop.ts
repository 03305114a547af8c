// A block that was let go where it does not fit: why, in a sentence at that place, and out of the way.
import * as Blockly from 'blockly/core';
import {freePlace, inSight, obstacles} from './free_place';
import {helpFor} from './help';
import {Hint} from './hint';
import {lazy, t} from './words';

/** How near a gap was meant, in pixels of the screen. */
const NEAR = 30;
const ASIDE = 28;
const EMPTY_GAP = 40;

const TAKES: Readonly<Record<string, string>> = {
  Number: lazy('a number'),
  String: lazy('a text'),
  Boolean: lazy('yes or no'),
  List: lazy('a list'),
};

const ANOTHER = lazy('another value');

interface Refusal {
  /** The block at whose gap, or below which, it was let go. */
  by: Blockly.BlockSvg;
  sentence: string;
  /** Where that is on the canvas. */
  place: Blockly.utils.Coordinate;
}

export class WrongDrops {
  private readonly hint: Hint;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    this.hint = new Hint(workspace);
  }

  dispose(): void {
    this.hint.dispose();
  }

  /** Says why it did not join, if it was let go at something; moves it aside when it covers that. */
  explain(block: Blockly.BlockSvg, mouse: Blockly.utils.Coordinate): void {
    this.tell(block, this.refusal(block, Blockly.utils.svgMath.screenToWsCoordinates(this.workspace, mouse)));
  }

  /** The same for a value that was put down with the keys: ``meant`` had them before, a gap, a field or a block. */
  explainAt(block: Blockly.BlockSvg, meant: Blockly.IFocusableNode): void {
    if (block.outputConnection) this.tell(block, refusedBy(block, meant));
  }

  private tell(block: Blockly.BlockSvg, refusal: Refusal | null): void {
    if (!refusal) return;
    const at = Blockly.utils.svgMath.wsToScreenCoordinates(this.workspace, refusal.place);
    this.hint.show(refusal.sentence, at);
    this.moveAside(block, refusal.by);
  }

  private moveAside(block: Blockly.BlockSvg, by: Blockly.BlockSvg): void {
    const mine = block.getBoundingRectangle();
    const its = by.getBoundingRectangleWithoutChildren();
    const inputs = by.getHeightWidth();
    const right = Math.max(its.right, by.getRelativeToSurfaceXY().x + inputs.width);
    its.right = right;
    const said = this.hint.bounds;
    const corner = (x: number, y: number) =>
      Blockly.utils.svgMath.screenToWsCoordinates(this.workspace, new Blockly.utils.Coordinate(x, y));
    const [from, to] = [corner(said.left, said.top), corner(said.right, said.bottom)];
    const bubble = new Blockly.utils.Rect(from.y, to.y, from.x, to.x);
    if (mine.intersects(its)) shift(block, right + ASIDE - mine.left, mine);
    if (mine.intersects(bubble)) shift(block, bubble.right + ASIDE - mine.left, mine);
    this.uncover(block, mine, bubble);
  }

  /** Where it lies now may be another script: then it goes to the next free place. */
  private uncover(block: Blockly.BlockSvg, mine: Blockly.utils.Rect, bubble: Blockly.utils.Rect): void {
    const others = obstacles(this.workspace, new Set([block]));
    if (!others.some((other) => other.intersects(mine))) return;
    const wanted = new Blockly.utils.Coordinate(mine.left, mine.top);
    const size = {width: mine.getWidth(), height: mine.getHeight()};
    const place = freePlace(wanted, size, [...others, bubble], inSight(this.workspace), ASIDE);
    block.moveBy(place.x - mine.left, place.y - mine.top, ['bump']);
  }

  private refusal(block: Blockly.BlockSvg, mouse: Blockly.utils.Coordinate): Refusal | null {
    const own = new Set(block.getDescendants(false));
    const near = NEAR / this.workspace.scale;
    let best: Refusal | null = null;
    let nearest = Infinity;
    const look = (distance: number, make: () => Refusal | null) => {
      if (distance >= nearest) return;
      const made = make();
      if (made) [best, nearest] = [made, distance];
    };
    const corner = block.getRelativeToSurfaceXY();
    for (const other of this.workspace.getAllBlocks(false)) {
      if (own.has(other) || other.isShadow() || other.isInsertionMarker() || other.isCollapsed()) continue;
      for (const input of other.inputList) {
        const gap = input.connection as Blockly.RenderedConnection | null;
        if (!gap || !input.isVisible()) continue;
        const distance = Math.min(far(corner, gap), inGap(gap, mouse) ? 0 : Infinity);
        if (distance < near) look(distance, () => atGap(block, other, gap));
      }
      const end = below(other);
      if (end && far(corner, end) < near) look(far(corner, end), () => under(block, other, end));
    }
    return best;
  }
}

/** Why a value does not go where the keys were. */
function refusedBy(block: Blockly.BlockSvg, meant: Blockly.IFocusableNode): Refusal | null {
  if (meant instanceof Blockly.RenderedConnection) return atGap(block, meant.getSourceBlock(), meant);
  const held = meant instanceof Blockly.Field ? meant.getSourceBlock() : meant;
  if (!(held instanceof Blockly.BlockSvg)) return null;
  if (held.isShadow() && held.outputConnection?.targetConnection) {
    const gap: Blockly.RenderedConnection = held.outputConnection.targetConnection;
    return atGap(block, gap.getSourceBlock(), gap);
  }
  const gaps = held.inputList.map((input) => input.connection as Blockly.RenderedConnection | null)
    .filter((gap): gap is Blockly.RenderedConnection => gap?.type === Blockly.ConnectionType.INPUT_VALUE);
  for (const gap of gaps) {
    const refusal = atGap(block, held, gap);
    if (refusal) return refusal;
  }
  const end = below(held);
  return end && under(block, held, end);
}

function shift(block: Blockly.BlockSvg, by: number, box: Blockly.utils.Rect): void {
  block.moveBy(by, 0, ['bump']);
  box.left += by;
  box.right += by;
}

function far(one: {x: number; y: number}, other: {x: number; y: number}): number {
  return Math.hypot(one.x - other.x, one.y - other.y);
}

/** Where the next block begins, or would. */
function below(block: Blockly.BlockSvg): Blockly.utils.Coordinate | null {
  if (block.outputConnection) return null;
  const {x, y} = block.getRelativeToSurfaceXY();
  const {nextConnection} = block;
  if (nextConnection) return new Blockly.utils.Coordinate(nextConnection.x, nextConnection.y);
  return new Blockly.utils.Coordinate(x, y + block.getHeightWidth().height);
}

/** Whether the mouse is in a gap for a value. */
function inGap(gap: Blockly.RenderedConnection, mouse: Blockly.utils.Coordinate): boolean {
  if (gap.type !== Blockly.ConnectionType.INPUT_VALUE) return false;
  const held = gap.targetBlock();
  if (held && !held.isShadow()) return false;
  const size = held?.getHeightWidth() ?? {width: EMPTY_GAP, height: EMPTY_GAP};
  return mouse.x > gap.x && mouse.x < gap.x + size.width && mouse.y > gap.y - 4 && mouse.y < gap.y + size.height;
}

function atGap(block: Blockly.BlockSvg, other: Blockly.BlockSvg, gap: Blockly.RenderedConnection): Refusal | null {
  const place = new Blockly.utils.Coordinate(gap.x, gap.y);
  const name = nameOf(block);
  if (gap.type === Blockly.ConnectionType.NEXT_STATEMENT) {
    return block.outputConnection ? {by: other, place, sentence: isValue(name)} : null;
  }
  if (!block.outputConnection) {
    return {by: other, place, sentence: t('“{block}” doesn\'t return a value, so it doesn\'t fit into a value slot. Place it below another block.', {block: name})};
  }
  const check = gap.getCheck();
  const gives = block.outputConnection.getCheck();
  if (!check || !gives || check.some((each) => gives.includes(each))) return null;
  const kind = check[0] ?? '';
  const what = t(TAKES[kind] ?? ANOTHER);
  const owner = helpFor(other.type)?.name;
  const sentence = owner ? t('“{block}” needs {what} here', {block: owner, what}) : t('This slot needs {what}', {what});
  return {by: other, place, sentence};
}

function under(block: Blockly.BlockSvg, other: Blockly.BlockSvg, place: Blockly.utils.Coordinate): Refusal | null {
  const name = nameOf(block);
  if (block.outputConnection) return {by: other, place, sentence: isValue(name)};
  if (!block.previousConnection) {
    return {by: other, place, sentence: t('“{block}” starts a script, so no block can be above it', {block: name})};
  }
  if (!other.nextConnection) return {by: other, place, sentence: t('“{block}” can\'t have blocks below it', {block: nameOf(other)})};
  if (block.nextConnection || !other.getNextBlock()) return null;
  return {by: other, place, sentence: t('“{block}” can\'t have blocks below it. Place it at the end.', {block: name})};
}

function isValue(name: string): string {
  return t('“{block}” is a value. Drag it into a slot of another block.', {block: name});
}

function nameOf(block: Blockly.BlockSvg): string {
  return helpFor(block.type)?.name || t('this block');
}
