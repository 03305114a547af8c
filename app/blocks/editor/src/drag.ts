// Dragging of blocks: snap radius, delete areas, selections, and drags out of the flyout or out of the page.
import * as Blockly from 'blockly/core';
import {highlightBackpack, isOverBackpack, isInBackpack, addToBackpack} from './backpack';
import {DraggedGroup} from './carry';
import {type OutgoingDrag, isOutsideViewport, createOutgoingDrag, createOutgoingGroupDrag} from './outgoing_drag';
import {type Item, getSelectedBlocksWith, isNote, getSelectedNotesWith, groupIntoStacks} from './selection';
import {sheetOf} from './sheet';

/** Snap radius in screen pixels; larger for the connection being previewed, so that it is kept a little longer. */
const SNAP_RADIUS = 28;
const CONNECTING_SNAP_RADIUS = 36;
const DEFAULT_CONFIG = {...Blockly.config};

export interface DragListener {
  /** Called with the mouse position while a drop would delete the dragged block, otherwise with null. */
  overDelete(mouse: Blockly.utils.Coordinate | null): void;
  /** Called when a block was dropped on the canvas without connecting; `mouse` is relative to the page. */
  dropped(block: Blockly.BlockSvg, mouse: Blockly.utils.Coordinate): void;
  /** Called when a block was placed by keyboard without connecting; `insertionTarget` had the focus before. */
  placedByKeyboard(block: Blockly.BlockSvg, insertionTarget: Blockly.IFocusableNode): void;
  /** Called with the mouse position while items are dragged outside the page, otherwise with null. */
  outside(mouse: Blockly.utils.Coordinate | null, items?: readonly Item[]): void;
  /** Called when items were dropped outside the page and have returned to their place. */
  droppedOutside(drag: OutgoingDrag, mouse: Blockly.utils.Coordinate): void;
  /** Called when the drag has ended; `isPlaced` is false if it was reverted, `isCopy` is true if Ctrl was pressed. */
  ended(isPlaced: boolean, isCopy: boolean): void;
}

/** Items dragged here from another behaviour; dropped on the toolbox, they return there. */
const visitingItems = new WeakSet<object>();

const listeners = new WeakMap<Blockly.Workspace, DragListener>();

export function setDragListener(workspace: Blockly.WorkspaceSvg, listener: DragListener): void {
  listeners.set(workspace, listener);
}

/** Length of the synthetic mouse move that starts a drag, in pixels; exceeds every drag radius of Blockly. */
const DRAG_DISTANCE = 60;

/** Starts dragging an item with the pointer that is already down, as if pressed at `position` on the page. */
export function startDragAt(item: Item, position: Blockly.utils.Coordinate, {pointerId, pointerType}: PointerEvent): void {
  const createEvent = (type: string, x: number) => new PointerEvent(type,
    {clientX: x, clientY: position.y, pointerId, pointerType, isPrimary: true, button: 0, buttons: 1, cancelable: true});
  const downEvent = createEvent('pointerdown', position.x);
  visitingItems.add(item);
  Blockly.Touch.clearTouchIdentifier();
  Blockly.Touch.checkTouchIdentifier(downEvent);  // make Blockly follow this pointer
  const gesture = item.workspace.getGesture(downEvent);
  if (item instanceof Blockly.BlockSvg) gesture?.handleBlockStart(downEvent, item);
  else gesture?.handleCommentStart(downEvent, item);
  gesture?.handleWsStart(downEvent, item.workspace);
  gesture?.handleMove(createEvent('pointermove', position.x + DRAG_DISTANCE));
}

/** Blockly doesn't export the connection candidate of a drag. */
interface HasDragStrategy {
  dragStrategy?: {connectionCandidate?: unknown};
}

class Dragger extends Blockly.dragging.Dragger {
  /** Scale of the flyout that the block came from, or 0 for a block of the canvas. */
  private readonly flyoutScale = this.draggable instanceof Blockly.BlockSvg && this.draggable.workspace.isFlyout ?
    this.draggable.workspace.scale : 0;
  /** Sheet that the block came from; it closes so that the whole canvas is free for the drop. */
  private readonly sheet = this.draggable instanceof Blockly.BlockSvg ? sheetOf(this.draggable) : null;
  private readonly isFromBackpack = this.draggable instanceof Blockly.BlockSvg && isInBackpack(this.draggable);
  private readonly isVisitor = visitingItems.has(this.draggable);
  private isGripAdjusted = false;
  private hasEnded = false;
  /** Node of the canvas that had the focus when a block was taken from the toolbox by keyboard. */
  private insertionTarget: Blockly.IFocusableNode | null = null;
  /** Other selected blocks and notes, which are dragged along. */
  private carried: DraggedGroup | null = null;

  override onDragStart(event?: PointerEvent | KeyboardEvent): Blockly.IDraggable {
    this.attachSelection();
    if (this.flyoutScale && event instanceof KeyboardEvent) this.insertionTarget = passivelyFocusedNode(this.draggable.workspace);
    // Ctrl detaches a single block from its script; the blocks of a group are detached already.
    const dragged = super.onDragStart(this.carried && event instanceof PointerEvent ? undefined : event);
    this.carried?.start();
    this.sheet?.hide();
    this.setSnapRadius();
    return dragged;
  }

  private attachSelection(): void {
    const item: Item | null = this.draggable instanceof Blockly.BlockSvg || isNote(this.draggable) ? this.draggable : null;
    const blocks = getSelectedBlocksWith(item).filter((block) => block.isMovable());
    const notes = getSelectedNotesWith(item).filter((note) => note.isMovable());
    if (!item || !(blocks.length || notes.length)) return;
    if (!Blockly.Events.getGroup()) Blockly.Events.setGroup(true);
    this.carried = new DraggedGroup(groupIntoStacks(blocks), notes, item);
    this.draggable = this.carried.head;
  }

  /** Offset of the dragged item from its start position, in workspace units. */
  private get offset(): Blockly.utils.Coordinate {
    const {draggable, startLoc} = this;
    const position = draggable.getRelativeToSurfaceXY();
    // Blockly snaps a dropped block to the grid only after the next frame.
    const grid = draggable instanceof Blockly.BlockSvg && !draggable.isDragging() && !draggable.getParent() ?
      draggable.workspace.getGrid() : null;
    return Blockly.utils.Coordinate.difference(grid?.shouldSnap() ? grid.alignXY(position) : position, startLoc);
  }

  override onDrag(event: PointerEvent | KeyboardEvent | undefined, delta: Blockly.utils.Coordinate): void {
    this.setSnapRadius();
    if (event instanceof PointerEvent) this.compensateFlyoutScale(event, delta);
    super.onDrag(event, delta);
    this.carried?.move(this.pixelsToWorkspaceUnits(delta));
    if (!(event instanceof PointerEvent)) return;
    this.notifyOverDelete(this.wouldDelete(event) ? mousePosition(event) : null);
    if (this.isDraggedOutside(mousePosition(event))) this.listener?.outside(mousePosition(event), this.items);
    else this.listener?.outside(null);
    highlightBackpack(this.canDropIntoBackpack(mousePosition(event)));
  }

  override onDragEnd(event?: PointerEvent | KeyboardEvent): void {
    if (this.hasEnded) return;  // deleting the block at the end of a gesture ends the gesture again
    this.hasEnded = true;
    const {listener} = this;
    const mouse = event instanceof PointerEvent ? mousePosition(event) : null;
    const isPlaced = !mouse || !(this.isDroppedElsewhere(mouse) || this.isVisitorOverDeleteArea(mouse));
    this.endDrag(event);
    visitingItems.delete(this.draggable);
    listener?.ended(isPlaced, Boolean(event?.ctrlKey || event?.metaKey));
  }

  private endDrag(event?: PointerEvent | KeyboardEvent): void {
    const {draggable} = this;
    const mouse = event instanceof PointerEvent ? mousePosition(event) : null;
    const {listener} = this;
    const outgoing = mouse && this.isDroppedElsewhere(mouse) ? this.createOutgoing(event as PointerEvent) : null;
    const isConnecting = Boolean((draggable as unknown as HasDragStrategy).dragStrategy?.connectionCandidate);
    const isUnconnected = mouse && !isConnecting && !this.wouldDelete(event as PointerEvent) && !this.isVisitorOverDeleteArea(mouse);
    const group = Blockly.Events.getGroup();
    const {carried, offset, insertionTarget} = this;
    const restoreGridSnap = outgoing ? suspendGridSnap(draggable) : null;
    super.onDragEnd(event);
    this.resetDragFeedback();
    restoreGridSnap?.();
    if (carried && outgoing) {
      Blockly.Events.setGroup(group || true);
      carried.revert();
      discardUndoGroup(draggable.workspace, Blockly.Events.getGroup());
      Blockly.Events.setGroup(false);
    }
    if (outgoing && mouse && isOutsideViewport(mouse)) listener?.droppedOutside(outgoing, mouse);
    else if (outgoing && !this.isFromBackpack) addToBackpack(outgoing.copied);
    if (outgoing) return;
    if (carried) {
      Blockly.Events.setGroup(group);
      if (draggable.workspace && (draggable as Blockly.BlockSvg).isDeadOrDying()) carried.remove();
      else carried.end(isConnecting ? offset : this.offset);
      Blockly.Events.setGroup(false);
      return;
    }
    if (!mouse && insertionTarget && !isConnecting && draggable instanceof Blockly.BlockSvg && !draggable.isDeadOrDying()) {
      listener?.placedByKeyboard(draggable, insertionTarget);
    }
    if (!isUnconnected || !(draggable instanceof Blockly.BlockSvg) || draggable.isDeadOrDying()) return;
    const before = Blockly.Events.getGroup();
    Blockly.Events.setGroup(group);  // edits caused by the drop belong to its undo step
    listener?.dropped(draggable, mouse);
    Blockly.Events.setGroup(before);
  }

  override onDragRevert(event?: PointerEvent | KeyboardEvent): void {
    const group = Blockly.Events.getGroup();
    const {listener} = this;
    super.onDragRevert(event);
    this.resetDragFeedback();
    if (this.carried) {
      Blockly.Events.setGroup(group || true);
      this.carried.revert();
      discardUndoGroup(this.draggable.workspace, Blockly.Events.getGroup());
      Blockly.Events.setGroup(group);
    }
    visitingItems.delete(this.draggable);
    listener?.ended(false, false);
  }

  /** Prevents deletion outside the page and on the backpack: the block returns to its place or to the toolbox. */
  protected override wouldDeleteDraggable(mouse: Blockly.utils.Coordinate,
    draggable: Blockly.IDraggable & Blockly.IDeletable): boolean {
    if (this.isDroppedElsewhere(mouse)) return this.flyoutScale > 0;
    return !this.isVisitor && super.wouldDeleteDraggable(mouse, draggable);
  }

  protected override shouldReturnToStart(mouse: Blockly.utils.Coordinate, draggable: Blockly.IDraggable): boolean {
    return this.isDroppedElsewhere(mouse) ? !this.flyoutScale : this.isVisitorOverDeleteArea(mouse) || super.shouldReturnToStart(mouse, draggable);
  }

  /** Returns true if an item from another behaviour is over a delete area; it returns there and isn't deleted. */
  private isVisitorOverDeleteArea(mouse: Blockly.utils.Coordinate): boolean {
    return this.isVisitor && Blockly.isDeletable(this.draggable) && super.wouldDeleteDraggable(mouse, this.draggable);
  }

  /** Dragged items, each including the blocks below it. */
  private get items(): readonly Item[] {
    if (this.carried) return [...this.carried.runs.map(([head]) => head!), ...this.carried.notes];
    return [this.draggable as unknown as Item];
  }

  /** Returns true if a drop here transfers the items elsewhere, so that they return to their place on this canvas. */
  private isDroppedElsewhere(mouse: Blockly.utils.Coordinate): boolean {
    return this.isDraggedOutside(mouse) || this.canDropIntoBackpack(mouse);
  }

  private canDropIntoBackpack(mouse: Blockly.utils.Coordinate): boolean {
    return (this.draggable instanceof Blockly.BlockSvg || Boolean(this.carried?.runs.length)) && isOverBackpack(mouse);
  }

  /** Returns true if blocks or notes are dragged outside the page. */
  private isDraggedOutside(mouse: Blockly.utils.Coordinate): boolean {
    return isOutsideViewport(mouse) && (this.draggable instanceof Blockly.BlockSvg ||
      this.draggable instanceof Blockly.comments.RenderedWorkspaceComment);
  }

  private createOutgoing(event: PointerEvent): OutgoingDrag | null {
    const isCopy = event.ctrlKey || event.metaKey;
    const {workspace} = this.draggable;
    const mouse = Blockly.utils.svgMath.screenToWsCoordinates(workspace, mousePosition(event));
    return this.carried ? createOutgoingGroupDrag(this.carried.runs, this.carried.notes, isCopy, mouse) :
      createOutgoingDrag(this.draggable, this.flyoutScale > 0, isCopy, mouse);
  }

  private get listener(): DragListener | undefined {
    return listeners.get(this.draggable.workspace);
  }

  /** Sets the snap radius, which is constant in screen pixels at any zoom. */
  private setSnapRadius(): void {
    const {scale} = this.draggable.workspace;
    Blockly.config.snapRadius = SNAP_RADIUS / scale;
    Blockly.config.connectingSnapRadius = CONNECTING_SNAP_RADIUS / scale;
  }

  private resetDragFeedback(): void {
    Object.assign(Blockly.config, DEFAULT_CONFIG);
    this.notifyOverDelete(null);
    this.listener?.outside(null);
    highlightBackpack(false);
    // Remove the hint about moving by keyboard once the move has ended.
    document.querySelector('.blocklyToast[data-toast-id$="MoveHint"]')?.remove();
  }

  /** Compensates for the flyout's own scale, so that the mouse stays at the same point of the block. */
  private compensateFlyoutScale(event: PointerEvent, delta: Blockly.utils.Coordinate): void {
    if (this.isGripAdjusted || !this.flyoutScale || !(this.draggable instanceof Blockly.BlockSvg)) return;
    this.isGripAdjusted = true;
    const {workspace} = this.draggable;
    const corner = Blockly.utils.svgMath.wsToScreenCoordinates(workspace, this.startLoc.clone());  // it modifies its argument
    const ratio = workspace.scale / this.flyoutScale;
    const shift = (mouse: number, from: number) => (mouse - from) * (1 - ratio) / workspace.scale;
    this.startLoc = Blockly.utils.Coordinate.sum(this.startLoc, new Blockly.utils.Coordinate(
      shift(event.clientX - delta.x, corner.x), shift(event.clientY - delta.y, corner.y)));
  }

  private wouldDelete(event: PointerEvent): boolean {
    return Blockly.isDeletable(this.draggable) && this.wouldDeleteDraggable(mousePosition(event), this.draggable);
  }

  /** Reports the delete area; not for a block from the flyout, which was never on the canvas. */
  private notifyOverDelete(mouse: Blockly.utils.Coordinate | null): void {
    this.listener?.overDelete(this.flyoutScale || this.isVisitor ? null : mouse);
  }
}

/** Returns the node of the canvas that gets the focus back when it leaves the flyout. */
function passivelyFocusedNode(flyout: Blockly.WorkspaceSvg): Blockly.IFocusableNode | null {
  const canvas = flyout.targetWorkspace;
  return canvas && Blockly.FocusableTreeTraverser.findFocusedNode(canvas);
}

/** Removes a reverted group from the undo stack, after the next frame, when Blockly has added it. */
export function discardUndoGroup(workspace: Blockly.WorkspaceSvg, group: string): void {
  window.requestAnimationFrame(() => window.setTimeout(() => {
    const steps = workspace.getUndoStack();
    while (steps.length && steps[steps.length - 1]?.group === group) steps.pop();
  }));
}

/** Disables snapping to the grid until rendering has finished, so that a reverted item returns exactly. */
function suspendGridSnap(item: Blockly.IDraggable): () => void {
  const snappable = item as {snapToGrid?: () => void};
  snappable.snapToGrid = () => undefined;
  return () => void Blockly.renderManagement.finishQueuedRenders().then(() => delete snappable.snapToGrid);
}

function mousePosition(event: PointerEvent): Blockly.utils.Coordinate {
  return new Blockly.utils.Coordinate(event.clientX, event.clientY);
}

export const DRAGGER = 'nep';
Blockly.registry.register(Blockly.registry.Type.BLOCK_DRAGGER, DRAGGER, Dragger);
