// Blocks or a note carried out of the page: the window sees where they are, and may take them to another behaviour.
// When it shows another behaviour while they are held, they stay in the hand: back on the page, they are dragged there.
import * as Blockly from 'blockly/core';
import {countBlocks} from './bin';
import {removeAll} from './carry';
import {type CopiedItem, type CopiedBlocks, pasteItems, copyOfAll, withUndoGroup, stateOf} from './clipboard';
import {discardUndoGroup, startDragAt} from './drag';
import {visibleArea} from './free_place';
import {renderPng, createPicture} from './picture';
import type {Item, Note} from './selection';
import type {Tab} from './tab';

type Point = Blockly.utils.Coordinate;

/** What is in the hand. It is where it was before once it is let go outside of the page. */
export interface OutgoingDrag {
  copied: CopiedItem | CopiedBlocks;
  /** How it goes to another behaviour: what comes from the toolbox was never here. */
  how: 'moved' | 'copied' | 'added';
  /** The blocks at the top of what goes; none: it is a note. */
  heads: Blockly.BlockSvg[];
  place: Point;
  /** Where the mouse holds it, from the corner of the first, in units of the canvas. */
  grip: Point;
  isGone(): boolean;
  /** Takes it away from where it is; its stack closes behind it. */
  remove(): void;
}

export interface CrossTabDragListener {
  /** Something in the hand, of the behaviour `home`, is outside of the page there; not `out`: it is not any more. */
  carried(x: number, y: number, out: boolean, home: string): void;
  /** How it looks, as a `data:` URL of a PNG with so many pixels in one of the page. */
  pictured(data: string, ratio: number): void;
  /** It was let go there. */
  dropped(x: number, y: number): void;
  /** So many blocks of the behaviour `from` are in the one that shows now; 0: it was a note. */
  brought(count: number, how: string, from: string): void;
}

interface UndoStep {
  tab: Tab;
  group: string;
  /** The same without undo, when other edits came later. */
  otherwise(): void;
}

/** What was held when another behaviour came to show: the mouse is still pressed. */
interface HeldDrag {
  from: Tab;
  what: OutgoingDrag;
  /** It lies on the page of the behaviour that shows, and is dragged there. */
  visit: VisitingCopy | null;
}

interface VisitingCopy {
  tab: Tab;
  made: Item[];
  group: string;
  /** The variables that were there before. */
  variables: ReadonlySet<string>;
}

/** How large a picture of what is carried is at most, in pixels of the page. */
const MAX_PICTURE_WIDTH = 360;
const MAX_PICTURE_HEIGHT = 240;

export function isOutsideViewport({x, y}: Point): boolean {
  return x < 0 || y < 0 || x >= window.innerWidth || y >= window.innerHeight;
}

/** What would leave the page with this; null: it stays. */
export function createOutgoingDrag(item: unknown, fromToolbox: boolean, copies: boolean, mouse: Point): OutgoingDrag | null {
  const isOne = item instanceof Blockly.BlockSvg || item instanceof Blockly.comments.RenderedWorkspaceComment;
  const copied = isOne ? stateOf(item, true) : null;
  if (!isOne || !copied) return null;
  const block = item instanceof Blockly.BlockSvg ? item : null;
  const isAlone = !block?.getNextBlock();
  return {
    copied,
    how: fromToolbox ? 'added' : copies || !item.isDeletable() ? 'copied' : 'moved',
    heads: block ? [block] : [],
    place: item.getRelativeToSurfaceXY(),
    grip: Blockly.utils.Coordinate.difference(mouse, item.getRelativeToSurfaceXY()),
    isGone: () => item.isDeadOrDying(),
    remove: () => block ? block.dispose(isAlone, false) : item.dispose(),
  };
}

/** The same of blocks and notes that were chosen together. */
export function createOutgoingGroupDrag(runs: readonly Blockly.BlockSvg[][], notes: readonly Note[], copies: boolean, mouse: Point): OutgoingDrag | null {
  const heads = runs.flatMap(([head]) => head ?? []);
  const first = heads[0] ?? notes[0];
  if (!first) return null;
  const all = [...runs.flat(), ...notes];
  return {
    copied: copyOfAll(runs, notes),
    how: copies || !all.every((item) => item.isDeletable()) ? 'copied' : 'moved',
    heads,
    place: first.getRelativeToSurfaceXY(),
    grip: Blockly.utils.Coordinate.difference(mouse, first.getRelativeToSurfaceXY()),
    isGone: () => all.some((item) => item.isDeadOrDying()),
    remove: () => removeAll(runs, notes),
  };
}

export class CrossTabDrag {
  private mouse: Point | null = null;
  private frame = 0;
  private isReported = false;
  private pendingDrop: {tab: Tab; what: OutgoingDrag} | null = null;
  /** What undoes the last one, the other behaviour first. */
  private steps: UndoStep[] = [];

  private hand: HeldDrag | null = null;
  /** Another behaviour comes to show, or what visits one goes: the ends of drags that follow are none of a person's. */
  private turning = false;
  /** The newest picture that was asked for. */
  private picture = 0;

  constructor(private readonly window: CrossTabDragListener, private readonly getActiveTab: () => Tab) {}

  /** Where the mouse is with these in the hand, while that is outside; told once in a frame. */
  trackOutside(mouse: Point | null, items: readonly Item[] = []): void {
    if (this.turning) return;
    if (mouse && this.hand?.visit) window.setTimeout(() => this.endVisit());  // not in the middle of its drag
    if (mouse && !this.mouse && items.length) void this.updateDragImage(items);
    this.mouse = mouse;
    if (mouse) this.frame ||= window.requestAnimationFrame(() => this.notifyPosition());
    else this.notifyPosition();
  }

  dropOutside(tab: Tab, drag: OutgoingDrag, mouse: Point): void {
    if (this.turning) {
      this.hand ??= this.startHolding({from: tab, what: drag, visit: null});
      return;
    }
    const {hand} = this;
    if (hand) this.stopHolding();
    this.pendingDrop = hand ? {tab: hand.from, what: hand.what} : {tab, what: drag};
    this.window.dropped(Math.round(mouse.x), Math.round(mouse.y));
  }

  /** Shows another behaviour. What is held outside of the page goes back to where it was, and stays in the hand. */
  switchTab(show: () => void): void {
    if (this.hand?.visit) this.endVisit();
    this.runWhileSwitching(show);
  }

  /** A drag on the page has ended; that of a visitor has brought it here, or it is where it was. */
  dragEnded(isPlaced: boolean, copies: boolean): void {
    const {hand} = this;
    if (this.turning || !hand?.visit) return;
    if (!isPlaced) return this.stopHolding();
    const {from, what, visit: {tab, made, group}} = hand;
    hand.visit = null;
    this.stopHolding();
    const how = copies && what.how === 'moved' ? 'copied' : what.how;
    const removes = how === 'moved' && !what.isGone();
    if (tab === from) {  // it came back by a detour
      if (removes) withEventGroup(group, what.remove);
      return;
    }
    this.steps = [createUndoStep(tab, group, made)];
    if (removes) this.removeOriginals(what, from);
    this.window.brought(countCopiedBlocks(what.copied), how, from.key);
  }

  /** Lays it free on the canvas of `to`, in sight and selected, and takes it away where it was. */
  dropInto(to: Tab): void {
    const {pendingDrop: held} = this;
    this.pendingDrop = null;
    if (!held || held.tab === to) return;
    const {tab: from, what} = held;
    this.steps = [];
    if (!this.insertCopy(what.copied, to)) return;
    if (what.how === 'moved' && !what.isGone()) this.removeOriginals(what, from);
    this.window.brought(countCopiedBlocks(what.copied), what.how, from.key);
  }

  /** Undoes the last `bring`, in both behaviours, after the edits of this frame have reached the lists of edits. */
  undoDrop(): void {
    const {steps} = this;
    this.steps = [];
    window.requestAnimationFrame(() => window.setTimeout(() => {
      for (const {tab, group, otherwise} of steps) {
        const stack = tab.workspace.getUndoStack();
        if (stack[stack.length - 1]?.group === group) tab.program.undo(false);
        else if (tab.workspace.rendered) otherwise();
      }
    }));
  }

  // -- in the hand, while another behaviour shows

  private startHolding(hand: HeldDrag): HeldDrag {
    window.addEventListener('pointermove', this.onMove, true);
    window.addEventListener('pointerup', this.onUp, true);
    window.addEventListener('keydown', this.onKey, true);
    return hand;
  }

  /** Nothing is in the hand any more; what it was is where it was. */
  private stopHolding(): void {
    if (this.hand?.visit) this.endVisit();
    this.hand = null;
    window.removeEventListener('pointermove', this.onMove, true);
    window.removeEventListener('pointerup', this.onUp, true);
    window.removeEventListener('keydown', this.onKey, true);
    Blockly.Events.setGroup(false);
    this.trackOutside(null);
  }

  private readonly onMove = (event: PointerEvent): void => {
    if (!this.hand || this.hand.visit) return;
    const mouse = new Blockly.utils.Coordinate(event.clientX, event.clientY);
    if (!(event.buttons & 1)) this.stopHolding();  // it was let go where the page could not see it
    else if (isOutsideViewport(mouse)) this.trackOutside(mouse);
    else this.startVisit(event, mouse);
  };

  private readonly onUp = (event: PointerEvent): void => {
    const {hand} = this;
    if (!hand || hand.visit) return;  // the drag on the page ends by itself
    const mouse = new Blockly.utils.Coordinate(event.clientX, event.clientY);
    if (isOutsideViewport(mouse)) this.dropOutside(hand.from, hand.what, mouse);
    else this.stopHolding();
  };

  private readonly onKey = (event: KeyboardEvent): void => {
    if (event.key === 'Escape' && this.hand && !this.hand.visit) this.stopHolding();
  };

  /** The mouse is on the page of another behaviour: it has a copy in the hand there, which a person drags on. */
  private startVisit(event: PointerEvent, mouse: Point): void {
    const hand = this.hand!;
    const tab = this.getActiveTab();
    const {workspace} = tab;
    const {scrollX, scrollY} = workspace;
    const {svgMath, Coordinate} = Blockly.utils;
    const dragPosition = Coordinate.difference(svgMath.screenToWsCoordinates(workspace, mouse), hand.what.grip);
    // Never left of what is in sight, as under the toolbox: Blockly would scroll to it, and all else would move.
    const {left, top} = visibleArea(workspace);
    const position = new Coordinate(Math.max(dragPosition.x, left), Math.max(dragPosition.y, top));
    const variables = new Set(workspace.getVariableMap().getAllVariables().map((variable) => variable.getId()));
    this.trackOutside(null);
    Blockly.Events.setGroup(true);  // until it is let go: all of it is one step
    const addedItems = pasteItems(hand.what.copied, workspace, position);
    const [first] = addedItems;
    if (!first) return this.stopHolding();
    workspace.scroll(scrollX, scrollY);  // what has the keys is brought into sight, but the hand leads this one
    hand.visit = {tab, made: addedItems, group: Blockly.Events.getGroup(), variables};
    const grip = Coordinate.sum(first.getRelativeToSurfaceXY(), hand.what.grip);
    startDragAt(first, svgMath.wsToScreenCoordinates(workspace, grip), event);
  }

  /** Takes what visits a behaviour out of it again, as if it had never been there. */
  private endVisit(): void {
    const visit = this.hand?.visit;
    if (!visit) return;
    this.hand!.visit = null;
    const {tab, made, group, variables} = visit;
    this.runWhileSwitching(() => tab.cancelInteraction());
    withEventGroup(group, () => {
      for (const item of made) if (!item.isDeadOrDying()) {
        tab.bin.markAsMoved(item.id);
        item.dispose();
      }
      const map = tab.workspace.getVariableMap();
      for (const variable of map.getAllVariables()) if (!variables.has(variable.getId())) map.deleteVariable(variable);
    });
    Blockly.Events.setGroup(false);
    discardUndoGroup(tab.workspace, group);
    window.requestAnimationFrame(() => window.setTimeout(() => tab === this.getActiveTab() && tab.program.notifyHistory()));
  }

  private runWhileSwitching(act: () => void): void {
    const before = this.turning;
    this.turning = true;
    try {
      act();
    } finally {
      this.turning = before;
    }
  }

  private async updateDragImage(items: readonly Item[]): Promise<void> {
    const mine = this.picture += 1;
    const {workspace} = items[0]!;
    const picture = await createPicture(workspace, false, new Set(items));
    if (!picture) return;
    const scale = Math.min(workspace.scale, MAX_PICTURE_WIDTH / picture.width, MAX_PICTURE_HEIGHT / picture.height);
    const ratio = window.devicePixelRatio;
    const data = await renderPng(picture, scale * ratio);
    if (mine === this.picture && this.mouse) this.window.pictured(data, ratio);
  }

  private notifyPosition(): void {
    window.cancelAnimationFrame(this.frame);
    this.frame = 0;
    if (!this.mouse && !this.isReported) return;
    this.isReported = this.mouse !== null;
    const home = (this.hand?.from ?? this.getActiveTab()).key;
    this.window.carried(Math.round(this.mouse?.x ?? 0), Math.round(this.mouse?.y ?? 0), this.isReported, home);
  }

  private insertCopy(copied: CopiedItem | CopiedBlocks, tab: Tab): boolean {
    const {workspace} = tab;
    const {left, right, top, bottom} = visibleArea(workspace);
    const position = new Blockly.utils.Coordinate(left + (right - left) / 4, top + (bottom - top) / 4);
    const [made, group] = withUndoGroup(() => [pasteItems(copied, workspace, position), Blockly.Events.getGroup()] as const);
    const [first] = made;
    if (!first) return false;
    const box = (first as Blockly.IBoundedElement).getBoundingRectangle();
    if (first instanceof Blockly.BlockSvg && !visibleArea(workspace).contains(box.left, box.top)) tab.reveal(first.id);
    this.steps.push(createUndoStep(tab, group, made));
    return true;
  }

  private removeOriginals({heads, copied, place, remove}: OutgoingDrag, tab: Tab): void {
    const position = heads[0]?.getRelativeToSurfaceXY() ?? place;
    const group = withUndoGroup(() => {
      for (const {id} of heads) tab.bin.markAsMoved(id);
      remove();
      return Blockly.Events.getGroup();
    });
    this.steps.push({tab, group, otherwise: () => void pasteItems(copied, tab.workspace, position)});
  }
}

/** What undoes that these were made. */
function createUndoStep(tab: Tab, group: string, items: readonly Item[]): UndoStep {
  return {tab, group, otherwise: () => withUndoGroup(() => items.forEach((item) => !item.isDeadOrDying() && item.dispose()))};
}

function withEventGroup(group: string, change: () => void): void {
  const before = Blockly.Events.getGroup();
  Blockly.Events.setGroup(group);
  try {
    change();
  } finally {
    Blockly.Events.setGroup(before);
  }
}

/** How many blocks a person sees in it; 0: it is a note. */
function countCopiedBlocks(copied: CopiedItem | CopiedBlocks): number {
  if (copied.nepStudio === 'note') return 0;
  const states = copied.nepStudio === 'blocks' ? copied.states : [copied.state];
  return states.reduce((sum, state) => sum + countBlocks(state as Blockly.serialization.blocks.State), 0);
}
