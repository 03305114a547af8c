// Dragging blocks or a note out of the page: the window follows the mouse and can move them to another
// behaviour. If it shows that behaviour meanwhile, the drag continues there once the mouse is back on the page.
import * as Blockly from 'blockly/core';
import {countBlocks} from './bin';
import {send} from './channel';
import {type CopiedItem, type CopiedBlocks, pasteItems, withUndoGroup} from './clipboard';
import {discardUndoGroup, startDragAt} from './drag';
import {visibleArea} from './free_place';
import type {PagePosition} from './messages';
import {type OutgoingDrag, isOutsideViewport} from './outgoing_drag';
import {renderPng, createPicture} from './picture';
import type {Item} from './selection';
import type {Tab} from './tab';

type Point = Blockly.utils.Coordinate;

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

  constructor(private readonly getActiveTab: () => Tab) {}

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
    send({type: 'blocksDroppedOutside', position: roundPosition(mouse)});
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
    send({type: 'blocksTransferred', count: countCopiedBlocks(drag.copied), mode: how, sourceTab: from.key});
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
    send({type: 'blocksTransferred', count: countCopiedBlocks(drag.copied), mode: drag.how, sourceTab: from.key});
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
    const png = await renderPng(picture, scale * ratio);
    if (mine === this.picture && this.mouse) send({type: 'dragImageRendered', png, ratio});
  }

  private notifyPosition(): void {
    window.cancelAnimationFrame(this.frame);
    this.frame = 0;
    if (!this.mouse && !this.isReported) return;
    this.isReported = this.mouse !== null;
    const tab = (this.hand?.from ?? this.getActiveTab()).key;
    send({type: 'blocksDraggedOutside', position: this.mouse && roundPosition(this.mouse), tab});
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

function roundPosition({x, y}: Point): PagePosition {
  return {x: Math.round(x), y: Math.round(y)};
}

/** Returns the number of blocks, or 0 for a note. */
function countCopiedBlocks(copied: CopiedItem | CopiedBlocks): number {
  if (copied.nepStudio === 'note') return 0;
  const states = copied.nepStudio === 'blocks' ? copied.states : [copied.state];
  return states.reduce((sum, state) => sum + countBlocks(state as Blockly.serialization.blocks.State), 0);
}
