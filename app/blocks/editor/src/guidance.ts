// Onboarding: the hints on an empty canvas, and a ring around the next block to use.
import * as Blockly from 'blockly/core';
import {send} from './channel';
import {iconElement} from './icons';
import {formatShortcut} from './keys';
import type {PointerTarget, SetCanvasHint} from './messages';
import {isKeyboardLed} from './modality';
import {t} from './words';

const POLL_MS = 120;
const FIRST_BLOCK_TYPE = 'events_started';
const RELEVANT_EVENTS = new Set<string>([
  Blockly.Events.BLOCK_CREATE, Blockly.Events.BLOCK_DELETE, Blockly.Events.BLOCK_DRAG,
  Blockly.Events.COMMENT_CREATE, Blockly.Events.COMMENT_DELETE, Blockly.Events.FINISHED_LOADING,
  Blockly.Events.TOOLBOX_ITEM_SELECT,
]);

function createElement<K extends keyof HTMLElementTagNameMap>(tag: K, className: string, text = ''): HTMLElementTagNameMap[K] {
  const node = document.createElement(tag);
  node.className = className;
  node.textContent = text;
  return node;
}

function isVisible(rect: DOMRect): boolean {
  return rect.width > 0 && rect.height > 0;
}

/** Hints on an empty canvas. Only the buttons receive mouse events, so that a block can be dropped anywhere. */
export class EmptyCanvas {
  private readonly box = createElement('aside', 'nepBegin');
  private readonly dropTarget = createElement('div', 'nepBeginPlace');
  private readonly categoryHint = createElement('p', '');
  private readonly byKeys = createElement('p', 'nepBeginKeys');
  private readonly robot: HTMLButtonElement;
  private hint: SetCanvasHint | null = null;
  private frame = 0;

  constructor(private readonly getWorkspace: () => Blockly.WorkspaceSvg, private readonly pointer: BlockPointer) {
    const buttons = createElement('div', 'nepBeginButtons');
    this.robot = this.addButton(buttons, 'bot', t('Use the virtual robot'), () => send({type: 'canvasButtonPressed', button: 'robot'}));
    this.robot.classList.add('primary');
    this.addButton(buttons, 'lightbulb', t('Show me'), (event) => this.showFirstBlock(event.detail === 0));
    this.addButton(buttons, 'blocks', t('Open an example'), () => send({type: 'canvasButtonPressed', button: 'examples'}));
    this.byKeys.textContent = t('With the keyboard: press {toolbox}, choose the block with the arrow keys, press Enter to pick it up and Enter again to place it.',
      {toolbox: formatShortcut(Blockly.ShortcutItems.names.FOCUS_TOOLBOX)});
    this.box.append(this.dropTarget, this.categoryHint, this.byKeys, buttons);
    this.box.hidden = true;
    document.body.append(this.box);
    window.addEventListener('resize', () => this.scheduleUpdate());
  }

  setHint(hint: SetCanvasHint): void {
    this.hint = hint;
    this.dropTarget.textContent = t('Drag “{block}” here', {block: hint.blockLabel});
    this.robot.hidden = hint.hasRobot;
    this.scheduleUpdate();
  }

  /** Updates the hints, at most once per frame, after events that can make the canvas empty or fill it. */
  watch(workspace: Blockly.WorkspaceSvg): void {
    const toolbox = workspace.getInjectionDiv().querySelector('.blocklyToolbox');
    if (toolbox) new ResizeObserver(() => this.scheduleUpdate()).observe(toolbox);
    workspace.addChangeListener((event) => {
      if (RELEVANT_EVENTS.has(event.type)) this.scheduleUpdate();
    });
  }

  scheduleUpdate(): void {
    if (!this.frame) this.frame = window.requestAnimationFrame(() => this.update());
  }

  private update(): void {
    this.frame = 0;
    const workspace = this.getWorkspace();
    const dragged = workspace.isDragging() ? 1 : 0;
    const empty = workspace.getTopBlocks(false).length <= dragged && !workspace.getTopComments().length;
    document.body.classList.toggle('nepEmpty', empty);
    this.box.hidden = !empty || this.hint === null;
    if (this.box.hidden) return;
    this.box.classList.toggle('dragging', dragged > 0);
    const flyout = workspace.getFlyout();
    const open = flyout?.isVisible() ? flyout.getWidth() : 0;
    const toolbox = workspace.getInjectionDiv().querySelector<HTMLElement>('.blocklyToolbox');
    const left = (toolbox?.offsetWidth ?? 0) + open;
    this.box.style.left = `${left}px`;
    this.box.classList.toggle('narrow', document.body.clientWidth - left < 320);
    const events = findCategory(workspace, FIRST_BLOCK_TYPE);
    this.categoryHint.textContent = events ? t('You\'ll find it under {category}, on the left.', {category: events.getName()}) : '';
  }

  private showFirstBlock(isKeyboardClick: boolean): void {
    this.pointer.show({block: FIRST_BLOCK_TYPE, name: this.hint?.blockLabel ?? '', placementHint: t('Drag it onto the page')});
    if (isKeyboardClick) this.pointer.focusCategory();
  }

  private addButton(container: HTMLElement, icon: string, label: string, action: (event: MouseEvent) => void): HTMLButtonElement {
    const button = createElement('button', '');
    button.type = 'button';
    button.append(iconElement(icon, 16), createElement('span', '', label));
    button.onclick = action;
    container.append(button);
    return button;
  }
}

/** Ring around the category of a block, then around the block itself, until the block is on the canvas. */
export class BlockPointer {
  private readonly ring = createElement('div', 'nepRing');
  private readonly bubble = createElement('div', 'nepRingBubble');
  private target: PointerTarget | null = null;
  private before = 0;
  private timer = 0;

  constructor(private readonly getWorkspace: () => Blockly.WorkspaceSvg) {
    this.bubble.setAttribute('role', 'status');
    document.addEventListener('keydown', (event) => {
      if (event.key === 'Escape') this.show(null);
    }, true);
  }

  show(target: PointerTarget | null): void {
    window.clearInterval(this.timer);
    this.target = target;
    if (!target) {
      this.ring.remove();
      this.bubble.remove();
      return;
    }
    this.before = this.countBlocks(target.block);
    document.body.append(this.ring, this.bubble);
    this.timer = window.setInterval(() => this.update(), POLL_MS);
    this.update();
  }

  /** Focuses the category that contains the block. */
  focusCategory(): void {
    const category = this.target && findCategory(this.getWorkspace(), this.target.block);
    if (!category) return;
    Blockly.keyboardNavigationController.setIsActive(true);
    Blockly.getFocusManager().focusNode(category);
  }

  private countBlocks(type: string): number {
    return this.getWorkspace().getBlocksByType(type, false).length;
  }

  private update(): void {
    const target = this.target;
    if (!target) return;
    const workspace = this.getWorkspace();
    const dragging = workspace.isDragging();
    if (!dragging && this.countBlocks(target.block) > this.before) return this.show(null);
    const block = findFlyoutBlock(workspace, target.block);
    const category = block ? null : findCategory(workspace, target.block);
    const highlighted = block ?? category?.getClickTarget() ?? null;
    const rect = highlighted?.getBoundingClientRect();
    const isTargetVisible = !dragging && rect !== undefined && isVisible(rect);
    this.ring.hidden = this.bubble.hidden = !isTargetVisible;
    if (!isTargetVisible) return;
    this.positionAround(rect);
    const text = this.hintText(block !== null, target, category?.getName() ?? '');
    if (this.bubble.textContent !== text) this.bubble.textContent = text;
  }

  /** Returns the hint; it mentions keys if the keyboard is in use. */
  private hintText(isOpen: boolean, {name, placementHint}: PointerTarget, category: string): string {
    const byKeys = isKeyboardLed();
    if (isOpen) return byKeys ? t('Press Enter to pick it up and Enter again to place it') : placementHint;
    const hint = t('You\'ll find “{block}” under {category}', {block: name, category});
    return byKeys ? `${hint} (${formatShortcut(Blockly.ShortcutItems.names.FOCUS_TOOLBOX)})` : hint;
  }

  private positionAround(rect: DOMRect): void {
    const out = 4;
    Object.assign(this.ring.style, {
      left: `${rect.left - out}px`, top: `${rect.top - out}px`,
      width: `${rect.width + 2 * out}px`, height: `${rect.height + 2 * out}px`,
    });
    const room = document.body.clientWidth - rect.right - 24;
    const fitsRight = room >= 160;
    this.bubble.classList.toggle('below', !fitsRight);
    Object.assign(this.bubble.style, {
      left: `${fitsRight ? rect.right + 18 : rect.left}px`,
      top: `${fitsRight ? rect.top + rect.height / 2 : rect.bottom + 16}px`,
      maxWidth: `${Math.max(160, Math.min(300, fitsRight ? room : document.body.clientWidth - rect.left - 16))}px`,
    });
  }
}

/** Returns the block of this type in the open category. */
function findFlyoutBlock(workspace: Blockly.WorkspaceSvg, type: string): Element | null {
  const flyout = workspace.getFlyout();
  if (!flyout?.isVisible()) return null;
  return flyout.getWorkspace().getTopBlocks(false).find((block) => block.type === type)?.pathObject.svgPath ?? null;
}

/** Returns the category that contains a block of this type. */
function findCategory(workspace: Blockly.WorkspaceSvg, type: string): Blockly.ToolboxCategory | null {
  for (const item of workspace.getToolbox()?.getToolboxItems() ?? []) {
    if (!(item instanceof Blockly.ToolboxCategory)) continue;
    const contents: unknown = item.getContents();
    if (Array.isArray(contents) && contents.some((entry: {type?: string}) => entry.type === type)) return item;
  }
  return null;
}
