// Dragging blocks or a note out of the page: the window follows the mouse and can move them to another
// behaviour. If it shows that behaviour meanwhile, the drag continues there once the mouse is back on the page.
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

export interface CrossTabDragListener {
  /** Called when items of the behaviour `home` are dragged outside the page; `isOutside` is false when that ends. */
  carried(x: number, y: number, isOutside: boolean, home: string): void;
  /** Called with the drag image, a `data:` URL of a PNG with `ratio` image pixels per pixel of the page. */
  pictured(data: string, ratio: number): void;
  /** Called when the items are dropped outside the page. */
  dropped(x: number, y: number): void;
  /** Called when `count` blocks have arrived from the behaviour `from`; 0 for a note. */
  brought(count: number, how: string, from: string): void;
}

interface UndoStep {
  tab: Tab;
  group: string;
  /** Reverts the change by an edit, used if the undo stack has later edits. */
  otherwise(): void;
}

/** Drag that continues after a switch to another behaviour while the mouse button is pressed. */
interface HeldDrag {
  from: Tab;
  drag: OutgoingDrag;
  /** Copy that is dragged in the shown behaviour, or null while the mouse is outside the page. */
  visit: VisitingCopy | null;
}

interface VisitingCopy {
  tab: Tab;
  items: Item[];
  group: string;
  /** Ids of the variables that existed before. */
  variables: ReadonlySet<string>;
}

/** Maximum size of the drag image, in pixels of the page. */
const MAX_PICTURE_WIDTH = 360;
const MAX_PICTURE_HEIGHT = 240;

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

export class CrossTabDrag {
  private mouse: Point | null = null;
  private frame = 0;
  private isReported = false;
  private pendingDrop: {tab: Tab; drag: OutgoingDrag} | null = null;
  /** Undo steps of the last drop, the target behaviour first. */
  private steps: UndoStep[] = [];

  private hand: HeldDrag | null = null;
  /** True while the tab is switched or a visiting copy is removed: drags that end then were not ended by the user. */
  private isSwitching = false;
  /** Number of the latest requested drag image. */
  private picture = 0;

  constructor(private readonly window: CrossTabDragListener, private readonly getActiveTab: () => Tab) {}

  /** Tracks the mouse outside the page and notifies the window at most once per frame; null when it is back inside. */
  trackOutside(mouse: Point | null, items: readonly Item[] = []): void {
    if (this.isSwitching) return;
    if (mouse && this.hand?.visit) window.setTimeout(() => this.endVisit());  // only after the current drag event has been handled
    if (mouse && !this.mouse && items.length) void this.updateDragImage(items);
    this.mouse = mouse;
    if (mouse) this.frame ||= window.requestAnimationFrame(() => this.notifyPosition());
    else this.notifyPosition();
  }

  dropOutside(tab: Tab, drag: OutgoingDrag, mouse: Point): void {
    if (this.isSwitching) {
      this.hand ??= this.startHolding({from: tab, drag, visit: null});
      return;
    }
    const {hand} = this;
    if (hand) this.stopHolding();
    this.pendingDrop = hand ? {tab: hand.from, drag: hand.drag} : {tab, drag};
    this.window.dropped(Math.round(mouse.x), Math.round(mouse.y));
  }

  /** Shows another behaviour. Items dragged outside the page return to their place, but the drag continues. */
  switchTab(show: () => void): void {
    if (this.hand?.visit) this.endVisit();
    this.runWhileSwitching(show);
  }

  /** Handles the end of a drag on the page; completes the transfer if a visiting copy was dropped. */
  dragEnded(isPlaced: boolean, isCopy: boolean): void {
    const {hand} = this;
    if (this.isSwitching || !hand?.visit) return;
    if (!isPlaced) return this.stopHolding();
    const {from, drag, visit: {tab, items, group}} = hand;
    hand.visit = null;
    this.stopHolding();
    const how = isCopy && drag.how === 'moved' ? 'copied' : drag.how;
    const shouldRemove = how === 'moved' && !drag.isGone();
    if (tab === from) {  // back in the original behaviour
      if (shouldRemove) withEventGroup(group, drag.remove);
      return;
    }
    this.steps = [createUndoStep(tab, group, items)];
    if (shouldRemove) this.removeOriginals(drag, from);
    this.window.brought(countCopiedBlocks(drag.copied), how, from.key);
  }

  /** Inserts the dropped items into the visible part of `to`, selected; deletes the originals of a move. */
  dropInto(to: Tab): void {
    const {pendingDrop: held} = this;
    this.pendingDrop = null;
    if (!held || held.tab === to) return;
    const {tab: from, drag} = held;
    this.steps = [];
    if (!this.insertCopy(drag.copied, to)) return;
    if (drag.how === 'moved' && !drag.isGone()) this.removeOriginals(drag, from);
    this.window.brought(countCopiedBlocks(drag.copied), drag.how, from.key);
  }

  /** Undoes the last drop in both behaviours, once this frame's edits have been added to the undo stacks. */
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

  // -- drag while another behaviour is shown

  private startHolding(hand: HeldDrag): HeldDrag {
    window.addEventListener('pointermove', this.onMove, true);
    window.addEventListener('pointerup', this.onUp, true);
    window.addEventListener('keydown', this.onKey, true);
    return hand;
  }

  /** Ends the drag; the originals stay in place. */
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
    if (!(event.buttons & 1)) this.stopHolding();  // released where the page receives no events
    else if (isOutsideViewport(mouse)) this.trackOutside(mouse);
    else this.startVisit(event, mouse);
  };

  private readonly onUp = (event: PointerEvent): void => {
    const {hand} = this;
    if (!hand || hand.visit) return;  // Blockly ends the drag on the page
    const mouse = new Blockly.utils.Coordinate(event.clientX, event.clientY);
    if (isOutsideViewport(mouse)) this.dropOutside(hand.from, hand.drag, mouse);
    else this.stopHolding();
  };

  private readonly onKey = (event: KeyboardEvent): void => {
    if (event.key === 'Escape' && this.hand && !this.hand.visit) this.stopHolding();
  };

  /** Starts dragging a copy in the shown behaviour when the mouse enters the page. */
  private startVisit(event: PointerEvent, mouse: Point): void {
    const hand = this.hand!;
    const tab = this.getActiveTab();
    const {workspace} = tab;
    const {scrollX, scrollY} = workspace;
    const {svgMath, Coordinate} = Blockly.utils;
    const dragPosition = Coordinate.difference(svgMath.screenToWsCoordinates(workspace, mouse), hand.drag.grip);
    // Never start left of the visible area (under the toolbox): Blockly would scroll the canvas to the focused item.
    const {left, top} = visibleArea(workspace);
    const position = new Coordinate(Math.max(dragPosition.x, left), Math.max(dragPosition.y, top));
    const variables = new Set(workspace.getVariableMap().getAllVariables().map((variable) => variable.getId()));
    this.trackOutside(null);
    Blockly.Events.setGroup(true);  // until the drop, so that the drag is one undo step
    const addedItems = pasteItems(hand.drag.copied, workspace, position);
    const [first] = addedItems;
    if (!first) return this.stopHolding();
    workspace.scroll(scrollX, scrollY);  // revert the scroll to the focused item; the mouse determines its position
    hand.visit = {tab, items: addedItems, group: Blockly.Events.getGroup(), variables};
    const grip = Coordinate.sum(first.getRelativeToSurfaceXY(), hand.drag.grip);
    startDragAt(first, svgMath.wsToScreenCoordinates(workspace, grip), event);
  }

  /** Removes the visiting copy and all its traces from the shown behaviour. */
  private endVisit(): void {
    const visit = this.hand?.visit;
    if (!visit) return;
    this.hand!.visit = null;
    const {tab, items, group, variables} = visit;
    this.runWhileSwitching(() => tab.cancelInteraction());
    withEventGroup(group, () => {
      for (const item of items) if (!item.isDeadOrDying()) {
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
    const before = this.isSwitching;
    this.isSwitching = true;
    try {
      act();
    } finally {
      this.isSwitching = before;
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
    const [items, group] = withUndoGroup(() => [pasteItems(copied, workspace, position), Blockly.Events.getGroup()] as const);
    const [first] = items;
    if (!first) return false;
    const box = (first as Blockly.IBoundedElement).getBoundingRectangle();
    if (first instanceof Blockly.BlockSvg && !visibleArea(workspace).contains(box.left, box.top)) tab.reveal(first.id);
    this.steps.push(createUndoStep(tab, group, items));
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

/** Returns the step that undoes the creation of these items. */
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

/** Returns the number of blocks, or 0 for a note. */
function countCopiedBlocks(copied: CopiedItem | CopiedBlocks): number {
  if (copied.nepStudio === 'note') return 0;
  const states = copied.nepStudio === 'blocks' ? copied.states : [copied.state];
  return states.reduce((sum, state) => sum + countBlocks(state as Blockly.serialization.blocks.State), 0);
}
