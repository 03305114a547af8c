// A frame drawn on the canvas chooses the blocks and notes that it touches: with Shift, or after a press of its button.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {ctrl} from './keys';
import {type Item, type Selection, areasOf, isNote, selectionOf} from './selection';
import {t} from './words';

/** How near the edge of the canvas the view moves along, and how far a picture, in pixels. */
const EDGE = 28;
const STEP = 14;

/** Pressed: the next drag on the canvas draws a frame, also without Shift. One for all behaviours. */
let button: HTMLButtonElement | null = null;

export function frameButton(): HTMLButtonElement {
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

function setArmed(armed: boolean): void {
  button?.setAttribute('aria-pressed', `${armed}`);
  document.documentElement.classList.toggle('nepFraming', armed);
}

interface Drawing {
  pointer: number;
  /** Where it began on the canvas, which the view may leave. */
  start: Blockly.utils.Coordinate;
  mouse: {x: number; y: number};
  areas: ReturnType<typeof areasOf>;
  /** What was chosen before and stays: Ctrl or Shift adds. */
  kept: Item[];
  found: Item[];
}

export class Frame {
  private readonly box = document.createElement('div');
  private drawing: Drawing | null = null;
  private waiting = 0;

  constructor(private readonly workspace: Blockly.WorkspaceSvg, private readonly selection: Selection) {
    this.box.className = 'nepFrame';
    this.box.hidden = true;
    const place = workspace.getInjectionDiv();
    place.append(this.box);
    place.addEventListener('pointerdown', (event) => this.begin(event), true);
    place.addEventListener('pointermove', (event) => this.move(event), true);
    place.addEventListener('pointerup', (event) => this.end(event), true);
    place.addEventListener('pointercancel', () => this.cancel());
    place.addEventListener('keydown', (event) => {
      if (event.key === 'Escape' && this.drawing) this.cancel();
    }, true);
  }

  private begin(event: PointerEvent): void {
    if (event.button !== 0 || !event.isPrimary || !(event.shiftKey || isArmed()) || !isCanvas(event.target)) return;
    event.stopPropagation();  // else the canvas would be moved
    event.preventDefault();
    const place = this.workspace.getInjectionDiv();
    place.setPointerCapture(event.pointerId);
    this.workspace.hideChaff();
    Blockly.getFocusManager().focusNode(this.workspace);
    const mouse = {x: event.clientX, y: event.clientY};
    const kept = event.shiftKey && !isArmed() || event.ctrlKey ? this.selection.items : [];
    this.drawing = {pointer: event.pointerId, start: this.toCanvas(mouse), mouse, areas: areasOf(this.workspace), kept, found: []};
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
    this.look(drawing);
    this.cancel();
    this.selection.choose([...drawing.kept, ...drawing.found]);
  }

  /** Leaves chosen what was chosen before. */
  private cancel(): void {
    window.cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    this.box.hidden = true;
    const {drawing} = this;
    this.drawing = null;
    if (drawing) this.selection.show(drawing.kept);
    setArmed(false);
  }

  private draw(): void {
    this.waiting = 0;
    const {drawing} = this;
    if (!drawing) return;
    if (this.scroll(drawing.mouse)) this.waiting = window.requestAnimationFrame(() => this.draw());
    this.look(drawing);
    const place = this.workspace.getInjectionDiv().getBoundingClientRect();
    const start = Blockly.utils.svgMath.wsToScreenCoordinates(this.workspace, drawing.start.clone());
    const {x, y} = drawing.mouse;
    this.box.hidden = false;
    this.box.style.left = `${Math.min(start.x, x) - place.left}px`;
    this.box.style.top = `${Math.min(start.y, y) - place.top}px`;
    this.box.style.width = `${Math.abs(start.x - x)}px`;
    this.box.style.height = `${Math.abs(start.y - y)}px`;
  }

  private look(drawing: Drawing): void {
    const end = this.toCanvas(drawing.mouse);
    const [left, right] = [Math.min(end.x, drawing.start.x), Math.max(end.x, drawing.start.x)];
    const [top, bottom] = [Math.min(end.y, drawing.start.y), Math.max(end.y, drawing.start.y)];
    drawing.found = drawing.areas.filter((area) => area.left < right && left < area.right && area.top < bottom && top < area.bottom)
      .map((area) => area.item);
    this.selection.show([...drawing.kept, ...drawing.found]);
  }

  /** Whether the view moved along, as the mouse is at its edge. */
  private scroll({x, y}: {x: number; y: number}): boolean {
    const view = this.workspace.getParentSvg().getBoundingClientRect();
    const left = view.left + this.workspace.getMetricsManager().getAbsoluteMetrics().left;
    const way = (at: number, low: number, high: number) => at < low + EDGE ? STEP : at > high - EDGE ? -STEP : 0;
    const [dx, dy] = [way(x, left, view.right), way(y, view.top, view.bottom)];
    const {scrollX, scrollY} = this.workspace;
    if (dx || dy) this.workspace.scroll(scrollX + dx, scrollY + dy);
    return this.workspace.scrollX !== scrollX || this.workspace.scrollY !== scrollY;
  }

  private toCanvas({x, y}: {x: number; y: number}): Blockly.utils.Coordinate {
    return Blockly.utils.svgMath.screenToWsCoordinates(this.workspace, new Blockly.utils.Coordinate(x, y));
  }
}

/** The canvas itself, no block, note or flyout. */
function isCanvas(target: EventTarget | null): boolean {
  return target instanceof Element && !target.closest('.blocklyFlyout') &&
    (target.classList.contains('blocklyMainBackground') || target.classList.contains('blocklySvg') ||
      target.classList.contains('blocklyWorkspace'));
}

const CHOOSE_ALL = 'nepChooseAll';

/** All blocks and notes of the shown behaviour: whole scripts, but for values that are inside of others. */
export function chooseAll(workspace: Blockly.WorkspaceSvg): void {
  const items: Item[] = workspace.getTopComments().filter(isNote);
  for (const top of workspace.getTopBlocks(true)) {
    for (let each: Blockly.BlockSvg | null = top; each; each = each.getNextBlock()) items.push(each);
  }
  selectionOf(workspace)?.choose(items);
}

export function registerChooseAll(): void {
  Blockly.ShortcutRegistry.registry.register({
    name: CHOOSE_ALL, keyCodes: [ctrl(Blockly.utils.KeyCodes.A)], displayText: () => t('Select all blocks and notes'),
    preconditionFn: (workspace) => !workspace.isDragging() && !Blockly.getFocusManager().ephemeralFocusTaken(),
    callback: (_workspace, event) => {
      event.preventDefault();
      chooseAll(Blockly.common.getMainWorkspace() as Blockly.WorkspaceSvg);
      return true;
    },
  });
}

/** The shortcut that menus show. */
export const CHOOSE_ALL_SHORTCUT = CHOOSE_ALL;
