// Marquee selection of blocks and notes: drag on the canvas with Shift, or after a click on its button.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {ctrl} from './keys';
import {type Item, type Selection, areasOf, isNote, selectionOf} from './selection';
import {t} from './words';

/** Distance from the edge of the canvas at which the view scrolls, and scroll step per frame, in pixels. */
const SCROLL_MARGIN = 28;
const SCROLL_STEP = 14;

/** Marquee button, shared by all behaviours: while pressed, the next drag on the canvas selects without Shift. */
let button: HTMLButtonElement | null = null;

export function marqueeButton(): HTMLButtonElement {
  if (button) return button;
  button = document.createElement('button');
  button.type = 'button';
  button.className = 'nepFrameButton';
  button.title = t('Select several blocks (or drag with Shift)');
  button.setAttribute('aria-label', t('Select several blocks'));
  button.append(iconElement('square-dashed-mouse-pointer', 18));
  button.onclick = () => setArmed(!isArmed());
  setArmed(false);
  document.addEventListener('keydown', (event) => event.key === 'Escape' && setArmed(false));
  return button;
}

function isArmed(): boolean {
  return button?.getAttribute('aria-pressed') === 'true';
}

function setArmed(isArmed: boolean): void {
  button?.setAttribute('aria-pressed', `${isArmed}`);
  document.documentElement.classList.toggle('nepFraming', isArmed);
}

interface MarqueeDrag {
  pointer: number;
  /** Start in workspace coordinates, which may scroll out of view. */
  start: Blockly.utils.Coordinate;
  mouse: {x: number; y: number};
  areas: ReturnType<typeof areasOf>;
  /** Items selected before, which Ctrl or Shift extends. */
  kept: Item[];
  found: Item[];
}

export class Marquee {
  private readonly box = document.createElement('div');
  private drawing: MarqueeDrag | null = null;
  private waiting = 0;

  constructor(private readonly workspace: Blockly.WorkspaceSvg, private readonly selection: Selection) {
    this.box.className = 'nepFrame';
    this.box.hidden = true;
    const injectionDiv = workspace.getInjectionDiv();
    injectionDiv.append(this.box);
    injectionDiv.addEventListener('pointerdown', (event) => this.begin(event), true);
    injectionDiv.addEventListener('pointermove', (event) => this.move(event), true);
    injectionDiv.addEventListener('pointerup', (event) => this.end(event), true);
    injectionDiv.addEventListener('pointercancel', () => this.cancel());
    injectionDiv.addEventListener('keydown', (event) => {
      if (event.key === 'Escape' && this.drawing) this.cancel();
    }, true);
  }

  private begin(event: PointerEvent): void {
    if (event.button !== 0 || !event.isPrimary || !(event.shiftKey || isArmed()) || !isCanvasElement(event.target)) return;
    event.stopPropagation();  // otherwise the drag would scroll the canvas
    event.preventDefault();
    const injectionDiv = this.workspace.getInjectionDiv();
    injectionDiv.setPointerCapture(event.pointerId);
    this.workspace.hideChaff();
    Blockly.getFocusManager().focusNode(this.workspace);
    const mouse = {x: event.clientX, y: event.clientY};
    const previouslySelected = event.shiftKey && !isArmed() || event.ctrlKey ? this.selection.items : [];
    this.drawing = {pointer: event.pointerId, start: this.toWorkspaceCoordinates(mouse), mouse, areas: areasOf(this.workspace), kept: previouslySelected, found: []};
  }

  private move(event: PointerEvent): void {
    if (event.pointerId !== this.drawing?.pointer) return;
    event.stopPropagation();
    this.drawing.mouse = {x: event.clientX, y: event.clientY};
    this.waiting ||= window.requestAnimationFrame(() => this.draw());
  }

  private end(event: PointerEvent): void {
    const {drawing} = this;
    if (event.pointerId !== drawing?.pointer) return;
    event.stopPropagation();
    drawing.mouse = {x: event.clientX, y: event.clientY};
    this.updateSelection(drawing);
    this.cancel();
    this.selection.select([...drawing.kept, ...drawing.found]);
  }

  /** Cancels the drag and restores the previous selection. */
  private cancel(): void {
    window.cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    this.box.hidden = true;
    const {drawing} = this;
    this.drawing = null;
    if (drawing) this.selection.setSelectedItems(drawing.kept);
    setArmed(false);
  }

  private draw(): void {
    this.waiting = 0;
    const {drawing} = this;
    if (!drawing) return;
    if (this.autoScroll(drawing.mouse)) this.waiting = window.requestAnimationFrame(() => this.draw());
    this.updateSelection(drawing);
    const injectionRect = this.workspace.getInjectionDiv().getBoundingClientRect();
    const start = Blockly.utils.svgMath.wsToScreenCoordinates(this.workspace, drawing.start.clone());
    const {x, y} = drawing.mouse;
    this.box.hidden = false;
    this.box.style.left = `${Math.min(start.x, x) - injectionRect.left}px`;
    this.box.style.top = `${Math.min(start.y, y) - injectionRect.top}px`;
    this.box.style.width = `${Math.abs(start.x - x)}px`;
    this.box.style.height = `${Math.abs(start.y - y)}px`;
  }

  private updateSelection(drawing: MarqueeDrag): void {
    const end = this.toWorkspaceCoordinates(drawing.mouse);
    const [left, right] = [Math.min(end.x, drawing.start.x), Math.max(end.x, drawing.start.x)];
    const [top, bottom] = [Math.min(end.y, drawing.start.y), Math.max(end.y, drawing.start.y)];
    drawing.found = drawing.areas.filter((area) => area.left < right && left < area.right && area.top < bottom && top < area.bottom)
      .map((area) => area.item);
    this.selection.setSelectedItems([...drawing.kept, ...drawing.found]);
  }

  /** Scrolls if the mouse is near the edge; returns true if the view moved. */
  private autoScroll({x, y}: {x: number; y: number}): boolean {
    const view = this.workspace.getParentSvg().getBoundingClientRect();
    const left = view.left + this.workspace.getMetricsManager().getAbsoluteMetrics().left;
    const scrollDelta = (coordinate: number, low: number, high: number) => coordinate < low + SCROLL_MARGIN ? SCROLL_STEP : coordinate > high - SCROLL_MARGIN ? -SCROLL_STEP : 0;
    const [dx, dy] = [scrollDelta(x, left, view.right), scrollDelta(y, view.top, view.bottom)];
    const {scrollX, scrollY} = this.workspace;
    if (dx || dy) this.workspace.scroll(scrollX + dx, scrollY + dy);
    return this.workspace.scrollX !== scrollX || this.workspace.scrollY !== scrollY;
  }

  private toWorkspaceCoordinates({x, y}: {x: number; y: number}): Blockly.utils.Coordinate {
    return Blockly.utils.svgMath.screenToWsCoordinates(this.workspace, new Blockly.utils.Coordinate(x, y));
  }
}

/** Returns true for the canvas itself: not a block, note or flyout. */
function isCanvasElement(target: EventTarget | null): boolean {
  return target instanceof Element && !target.closest('.blocklyFlyout') &&
    (target.classList.contains('blocklyMainBackground') || target.classList.contains('blocklySvg') ||
      target.classList.contains('blocklyWorkspace'));
}

const SELECT_ALL = 'nepChooseAll';

/** Selects all notes and the outer blocks of all scripts, which include the blocks inside them. */
export function selectAll(workspace: Blockly.WorkspaceSvg): void {
  const items: Item[] = workspace.getTopComments().filter(isNote);
  for (const top of workspace.getTopBlocks(true)) {
    for (let block: Blockly.BlockSvg | null = top; block; block = block.getNextBlock()) items.push(block);
  }
  selectionOf(workspace)?.select(items);
}

export function registerSelectAll(): void {
  Blockly.ShortcutRegistry.registry.register({
    name: SELECT_ALL, keyCodes: [ctrl(Blockly.utils.KeyCodes.A)], displayText: () => t('Select all blocks and notes'),
    preconditionFn: (workspace) => !workspace.isDragging() && !Blockly.getFocusManager().ephemeralFocusTaken(),
    callback: (_workspace, event) => {
      event.preventDefault();
      selectAll(Blockly.common.getMainWorkspace() as Blockly.WorkspaceSvg);
      return true;
    },
  });
}

/** Name of the shortcut, shown in menus. */
export const SELECT_ALL_SHORTCUT = SELECT_ALL;
