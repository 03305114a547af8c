// A block in the hand: how near is near, where letting go deletes, and how it leaves the flyout.
import * as Blockly from 'blockly/core';
import {highlightBackpack, isOverBackpack, isInBackpack, addToBackpack} from './backpack';
import {DraggedGroup} from './carry';
import {type Item, getSelectedBlocksWith, isNote, getSelectedNotesWith, groupIntoStacks} from './selection';
import {sheetOf} from './sheet';
import {type OutgoingDrag, isOutsideViewport, createOutgoingDrag, createOutgoingGroupDrag} from './carrying';

/** How near a gap has to be, in pixels of the screen; one that is offered already holds a little further. */
const SNAP_RADIUS = 28;
const CONNECTING_SNAP_RADIUS = 36;
const DEFAULT_CONFIG = {...Blockly.config};

export interface DragListener {
  /** Letting go of a block of the canvas here, on the page, would delete it; null: it would not. */
  overDelete(mouse: Blockly.utils.Coordinate | null): void;
  /** A block was let go on the canvas and joined nothing; where the mouse was on the page. */
  letGo(block: Blockly.BlockSvg, mouse: Blockly.utils.Coordinate): void;
  /** A block was put down with the keys and joined nothing; what had them when it was taken from the toolbox. */
  putDown(block: Blockly.BlockSvg, insertionTarget: Blockly.IFocusableNode): void;
  /** Where the mouse is with these in the hand while it is outside of the page; null: it is not. */
  outside(mouse: Blockly.utils.Coordinate | null, items?: readonly Item[]): void;
  /** It was let go there, and went back to where it was. */
  letGoOutside(drag: OutgoingDrag, mouse: Blockly.utils.Coordinate): void;
  /** The drag is over; `placed`: something lies or hangs where it was let go. `copies`: Ctrl was held. */
  ended(isPlaced: boolean, copies: boolean): void;
}

/** What comes from another behaviour with the mouse, which is still pressed: over the toolbox it goes back there. */
const visitingItems = new WeakSet<object>();

const listeners = new WeakMap<Blockly.Workspace, DragListener>();

export function setDragListener(workspace: Blockly.WorkspaceSvg, listener: DragListener): void {
  listeners.set(workspace, listener);
}

/** How far a mouse moves at least, in pixels, that drags; far enough for any radius of Blockly's. */
const DRAG_DISTANCE = 60;

/** Lets the mouse, which is pressed already, hold this as if it had been pressed on it `at` that place of the page. */
export function startDragAt(item: Item, position: Blockly.utils.Coordinate, {pointerId, pointerType}: PointerEvent): void {
  const like = (type: string, x: number) => new PointerEvent(type,
    {clientX: x, clientY: position.y, pointerId, pointerType, isPrimary: true, button: 0, buttons: 1, cancelable: true});
  const downEvent = like('pointerdown', position.x);
  visitingItems.add(item);
  Blockly.Touch.clearTouchIdentifier();
  Blockly.Touch.checkTouchIdentifier(downEvent);  // Blockly listens to the pointer that was pressed
  const gesture = item.workspace.getGesture(downEvent);
  if (item instanceof Blockly.BlockSvg) gesture?.handleBlockStart(downEvent, item);
  else gesture?.handleCommentStart(downEvent, item);
  gesture?.handleWsStart(downEvent, item.workspace);
  gesture?.handleMove(like('pointermove', position.x + DRAG_DISTANCE));
}

/** Blockly keeps what a drag would join to itself. */
interface HasDragStrategy {
  dragStrategy?: {connectionCandidate?: unknown};
}

class Dragger extends Blockly.dragging.Dragger {
  /** The zoom of the flyout that the block came from; 0: it was on the canvas. */
  private readonly flyoutScale = this.draggable instanceof Blockly.BlockSvg && this.draggable.workspace.isFlyout ?
    this.draggable.workspace.scale : 0;
  /** What it came out of: it closes, so that all of the canvas is there for it. */
  private readonly sheet = this.draggable instanceof Blockly.BlockSvg ? sheetOf(this.draggable) : null;
  private readonly wasPacked = this.draggable instanceof Blockly.BlockSvg && isInBackpack(this.draggable);
  private readonly isVisitor = visitingItems.has(this.draggable);
  private isGripAdjusted = false;
  private hasEnded = false;
  /** What had the keys on the canvas when a block was taken from the toolbox with them. */
  private insertionTarget: Blockly.IFocusableNode | null = null;
  /** The other blocks and notes that were chosen go along. */
  private carried: DraggedGroup | null = null;

  override onDragStart(event?: PointerEvent | KeyboardEvent): Blockly.IDraggable {
    this.attachSelection();
    if (this.flyoutScale && event instanceof KeyboardEvent) this.insertionTarget = passivelyFocusedNode(this.draggable.workspace);
    // Ctrl takes one block out of its script; of several each is out already.
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

  /** How far the one in the hand is from where it was taken, in units of the canvas. */
  private get offset(): Blockly.utils.Coordinate {
    const {draggable, startLoc} = this;
    const position = draggable.getRelativeToSurfaceXY();
    // Blockly moves what was let go onto the grid only after the next picture.
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
    if (this.hasEnded) return;  // the block that goes with the end of a gesture ends the gesture once more
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
    const leaves = mouse && this.isDroppedElsewhere(mouse) ? this.createOutgoing(event as PointerEvent) : null;
    const joins = Boolean((draggable as unknown as HasDragStrategy).dragStrategy?.connectionCandidate);
    const loose = mouse && !joins && !this.wouldDelete(event as PointerEvent) && !this.isVisitorOverDeleteArea(mouse);
    const group = Blockly.Events.getGroup();
    const {carried, offset: way, insertionTarget: meant} = this;
    const free = leaves ? suspendGridSnap(draggable) : null;
    super.onDragEnd(event);
    this.resetDragFeedback();
    free?.();
    if (carried && leaves) {
      Blockly.Events.setGroup(group || true);
      carried.revert();
      discardUndoGroup(draggable.workspace, Blockly.Events.getGroup());
      Blockly.Events.setGroup(false);
    }
    if (leaves && mouse && isOutsideViewport(mouse)) listener?.letGoOutside(leaves, mouse);
    else if (leaves && !this.wasPacked) addToBackpack(leaves.copied);
    if (leaves) return;
    if (carried) {
      Blockly.Events.setGroup(group);
      if (draggable.workspace && (draggable as Blockly.BlockSvg).isDeadOrDying()) carried.remove();
      else carried.end(joins ? way : this.offset);
      Blockly.Events.setGroup(false);
      return;
    }
    if (!mouse && meant && !joins && draggable instanceof Blockly.BlockSvg && !draggable.isDeadOrDying()) {
      listener?.putDown(draggable, meant);
    }
    if (!loose || !(draggable instanceof Blockly.BlockSvg) || draggable.isDeadOrDying()) return;
    const before = Blockly.Events.getGroup();
    Blockly.Events.setGroup(group);  // what follows from the drop is undone with it
    listener?.letGo(draggable, mouse);
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

  /** Outside of the page, and on the backpack, nothing is deleted: it goes back to where it was, to the toolbox if it came from there. */
  protected override wouldDeleteDraggable(mouse: Blockly.utils.Coordinate,
    draggable: Blockly.IDraggable & Blockly.IDeletable): boolean {
    if (this.isDroppedElsewhere(mouse)) return this.flyoutScale > 0;
    return !this.isVisitor && super.wouldDeleteDraggable(mouse, draggable);
  }

  protected override shouldReturnToStart(mouse: Blockly.utils.Coordinate, draggable: Blockly.IDraggable): boolean {
    return this.isDroppedElsewhere(mouse) ? !this.flyoutScale : this.isVisitorOverDeleteArea(mouse) || super.shouldReturnToStart(mouse, draggable);
  }

  /** Whether what came from another behaviour is over what deletes: it was never here, so it goes back there. */
  private isVisitorOverDeleteArea(mouse: Blockly.utils.Coordinate): boolean {
    return this.isVisitor && Blockly.isDeletable(this.draggable) && super.wouldDeleteDraggable(mouse, this.draggable);
  }

  /** What is in the hand, each with what hangs below it. */
  private get items(): readonly Item[] {
    if (this.carried) return [...this.carried.runs.map(([head]) => head!), ...this.carried.notes];
    return [this.draggable as unknown as Item];
  }

  /** Whether what is let go there goes elsewhere, and back to where it was here. */
  private isDroppedElsewhere(mouse: Blockly.utils.Coordinate): boolean {
    return this.isDraggedOutside(mouse) || this.canDropIntoBackpack(mouse);
  }

  private canDropIntoBackpack(mouse: Blockly.utils.Coordinate): boolean {
    return (this.draggable instanceof Blockly.BlockSvg || Boolean(this.carried?.runs.length)) && isOverBackpack(mouse);
  }

  /** Whether it is outside of the page there, as blocks and notes may be. */
  private isDraggedOutside(mouse: Blockly.utils.Coordinate): boolean {
    return isOutsideViewport(mouse) && (this.draggable instanceof Blockly.BlockSvg ||
      this.draggable instanceof Blockly.comments.RenderedWorkspaceComment);
  }

  private createOutgoing(event: PointerEvent): OutgoingDrag | null {
    const copies = event.ctrlKey || event.metaKey;
    const {workspace} = this.draggable;
    const mouse = Blockly.utils.svgMath.screenToWsCoordinates(workspace, mousePosition(event));
    return this.carried ? createOutgoingGroupDrag(this.carried.runs, this.carried.notes, copies, mouse) :
      createOutgoingDrag(this.draggable, this.flyoutScale > 0, copies, mouse);
  }

  private get listener(): DragListener | undefined {
    return listeners.get(this.draggable.workspace);
  }

  /** The radius is the screen's, whatever the zoom. */
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
    // How it is moved by keys is said no longer than it is moved.
    document.querySelector('.blocklyToast[data-toast-id$="MoveHint"]')?.remove();
  }

  /** The flyout has a zoom of its own: what is under the mouse there is under it here. */
  private compensateFlyoutScale(event: PointerEvent, delta: Blockly.utils.Coordinate): void {
    if (this.isGripAdjusted || !this.flyoutScale || !(this.draggable instanceof Blockly.BlockSvg)) return;
    this.isGripAdjusted = true;
    const {workspace} = this.draggable;
    const corner = Blockly.utils.svgMath.wsToScreenCoordinates(workspace, this.startLoc.clone());  // it scales what it is given
    const ratio = workspace.scale / this.flyoutScale;
    const shift = (mouse: number, from: number) => (mouse - from) * (1 - ratio) / workspace.scale;
    this.startLoc = Blockly.utils.Coordinate.sum(this.startLoc, new Blockly.utils.Coordinate(
      shift(event.clientX - delta.x, corner.x), shift(event.clientY - delta.y, corner.y)));
  }

  private wouldDelete(event: PointerEvent): boolean {
    return Blockly.isDeletable(this.draggable) && this.wouldDeleteDraggable(mousePosition(event), this.draggable);
  }

  /** What comes from the flyout and goes back there was never on the canvas. */
  private notifyOverDelete(mouse: Blockly.utils.Coordinate | null): void {
    this.listener?.overDelete(this.flyoutScale || this.isVisitor ? null : mouse);
  }
}

/** What has the keys on the canvas of a flyout as soon as they come back to it. */
function passivelyFocusedNode(flyout: Blockly.WorkspaceSvg): Blockly.IFocusableNode | null {
  const canvas = flyout.targetWorkspace;
  return canvas && Blockly.FocusableTreeTraverser.findFocusedNode(canvas);
}

/** What was put back is nothing to undo. Blockly lists edits after the next frame. */
export function discardUndoGroup(workspace: Blockly.WorkspaceSvg, group: string): void {
  window.requestAnimationFrame(() => window.setTimeout(() => {
    const steps = workspace.getUndoStack();
    while (steps.length && steps[steps.length - 1]?.group === group) steps.pop();
  }));
}

/** Blockly moves what was let go onto the grid, some only after the next picture: not what is where it was. */
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
