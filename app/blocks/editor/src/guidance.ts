// What helps a person begin: the words on an empty canvas, and a ring round the block that comes next.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {keyWords} from './keys';
import {isKeyboardLed} from './modality';
import {t} from './words';

const LOOK_MS = 120;
const FIRST = 'events_started';
const TOUCHING = new Set<string>([
  Blockly.Events.BLOCK_CREATE, Blockly.Events.BLOCK_DELETE, Blockly.Events.BLOCK_DRAG,
  Blockly.Events.COMMENT_CREATE, Blockly.Events.COMMENT_DELETE, Blockly.Events.FINISHED_LOADING,
  Blockly.Events.TOOLBOX_ITEM_SELECT,
]);

/** What the window knows: the words of "when started", and whether there is a robot. */
export interface Begin {
  first: string;
  robot: boolean;
}

/** A block to take, by its type; its name, and where to put it, in the person's words. */
export interface Wanted {
  block: string;
  name: string;
  then: string;
}

function element<K extends keyof HTMLElementTagNameMap>(tag: K, className: string, text = ''): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  made.className = className;
  made.textContent = text;
  return made;
}

function isSeen(rect: DOMRect): boolean {
  return rect.width > 0 && rect.height > 0;
}

/** The words on an empty canvas. Only its buttons take the mouse: a block can be dropped anywhere on it. */
export class EmptyCanvas {
  private readonly box = element('aside', 'nepBegin');
  private readonly place = element('div', 'nepBeginPlace');
  private readonly where = element('p', '');
  private readonly byKeys = element('p', 'nepBeginKeys');
  private readonly robot: HTMLButtonElement;
  private begin: Begin | null = null;
  private frame = 0;

  constructor(private readonly shown: () => Blockly.WorkspaceSvg, private readonly pointer: Pointer,
    ask: (what: string) => void) {
    const buttons = element('div', 'nepBeginButtons');
    this.robot = this.button(buttons, 'bot', t('Use the virtual robot'), () => ask('robot'));
    this.robot.classList.add('primary');
    this.button(buttons, 'lightbulb', t('Show me'), (event) => this.showMe(event.detail === 0));
    this.button(buttons, 'blocks', t('Open an example'), () => ask('examples'));
    this.byKeys.textContent = t('With the keyboard: press {toolbox}, choose it with the arrow keys, press Enter to pick it up and Enter again to place it.',
      {toolbox: keyWords(Blockly.ShortcutItems.names.FOCUS_TOOLBOX)});
    this.box.append(this.place, this.where, this.byKeys, buttons);
    this.box.hidden = true;
    document.body.append(this.box);
    window.addEventListener('resize', () => this.lookSoon());
  }

  tell(begin: Begin): void {
    this.begin = begin;
    this.place.textContent = t('Drag “{block}” here', {block: begin.first});
    this.robot.hidden = begin.robot;
    this.lookSoon();
  }

  /** Looks after what may have made the canvas empty, or ended that; once a frame at most. */
  watch(workspace: Blockly.WorkspaceSvg): void {
    const toolbox = workspace.getInjectionDiv().querySelector('.blocklyToolbox');
    if (toolbox) new ResizeObserver(() => this.lookSoon()).observe(toolbox);
    workspace.addChangeListener((event) => {
      if (TOUCHING.has(event.type)) this.lookSoon();
    });
  }

  lookSoon(): void {
    if (!this.frame) this.frame = window.requestAnimationFrame(() => this.look());
  }

  private look(): void {
    this.frame = 0;
    const workspace = this.shown();
    const dragged = workspace.isDragging() ? 1 : 0;
    const empty = workspace.getTopBlocks(false).length <= dragged && !workspace.getTopComments().length;
    document.body.classList.toggle('nepEmpty', empty);
    this.box.hidden = !empty || this.begin === null;
    if (this.box.hidden) return;
    this.box.classList.toggle('dragging', dragged > 0);
    const flyout = workspace.getFlyout();
    const open = flyout?.isVisible() ? flyout.getWidth() : 0;
    const toolbox = workspace.getInjectionDiv().querySelector<HTMLElement>('.blocklyToolbox');
    const left = (toolbox?.offsetWidth ?? 0) + open;
    this.box.style.left = `${left}px`;
    this.box.classList.toggle('narrow', document.body.clientWidth - left < 320);
    const events = categoryOf(workspace, FIRST);
    this.where.textContent = events ? t('You\'ll find it under {category}, on the left.', {category: events.getName()}) : '';
  }

  private showMe(byKey: boolean): void {
    this.pointer.show({block: FIRST, name: this.begin?.first ?? '', then: t('Drag it onto the page')});
    if (byKey) this.pointer.lead();
  }

  private button(place: HTMLElement, icon: string, words: string, action: (event: MouseEvent) => void): HTMLButtonElement {
    const made = element('button', '');
    made.type = 'button';
    made.append(iconElement(icon, 16), element('span', '', words));
    made.onclick = action;
    place.append(made);
    return made;
  }
}

/** A ring round the category that has a block, then round the block itself, until it is on the canvas. */
export class Pointer {
  private readonly ring = element('div', 'nepRing');
  private readonly bubble = element('div', 'nepRingBubble');
  private wanted: Wanted | null = null;
  private before = 0;
  private timer = 0;

  constructor(private readonly shown: () => Blockly.WorkspaceSvg) {
    this.bubble.setAttribute('role', 'status');
    document.addEventListener('keydown', (event) => {
      if (event.key === 'Escape') this.show(null);
    }, true);
  }

  show(wanted: Wanted | null): void {
    window.clearInterval(this.timer);
    this.wanted = wanted;
    if (!wanted) {
      this.ring.remove();
      this.bubble.remove();
      return;
    }
    this.before = this.count(wanted.block);
    document.body.append(this.ring, this.bubble);
    this.timer = window.setInterval(() => this.look(), LOOK_MS);
    this.look();
  }

  /** The keys go to the category that has it. */
  lead(): void {
    const category = this.wanted && categoryOf(this.shown(), this.wanted.block);
    if (!category) return;
    Blockly.keyboardNavigationController.setIsActive(true);
    Blockly.getFocusManager().focusNode(category);
  }

  private count(type: string): number {
    return this.shown().getBlocksByType(type, false).length;
  }

  private look(): void {
    const wanted = this.wanted;
    if (!wanted) return;
    const workspace = this.shown();
    const dragging = workspace.isDragging();
    if (!dragging && this.count(wanted.block) > this.before) return this.show(null);
    const block = blockIn(workspace, wanted.block);
    const category = block ? null : categoryOf(workspace, wanted.block);
    const found = block ?? category?.getClickTarget() ?? null;
    const rect = found?.getBoundingClientRect();
    const seen = !dragging && rect !== undefined && isSeen(rect);
    this.ring.hidden = this.bubble.hidden = !seen;
    if (!seen) return;
    this.put(rect);
    const words = this.words(block !== null, wanted, category?.getName() ?? '');
    if (this.bubble.textContent !== words) this.bubble.textContent = words;
  }

  /** Who uses the keys is told of keys. */
  private words(isOpen: boolean, {name, then}: Wanted, category: string): string {
    const byKeys = isKeyboardLed();
    if (isOpen) return byKeys ? t('Press Enter to pick it up and Enter again to place it') : then;
    const where = t('You\'ll find “{block}” under {category}', {block: name, category});
    return byKeys ? `${where} (${keyWords(Blockly.ShortcutItems.names.FOCUS_TOOLBOX)})` : where;
  }

  private put(rect: DOMRect): void {
    const out = 4;
    Object.assign(this.ring.style, {
      left: `${rect.left - out}px`, top: `${rect.top - out}px`,
      width: `${rect.width + 2 * out}px`, height: `${rect.height + 2 * out}px`,
    });
    const room = document.body.clientWidth - rect.right - 24;
    const beside = room >= 160;
    this.bubble.classList.toggle('below', !beside);
    Object.assign(this.bubble.style, {
      left: `${beside ? rect.right + 18 : rect.left}px`,
      top: `${beside ? rect.top + rect.height / 2 : rect.bottom + 16}px`,
      maxWidth: `${Math.max(160, Math.min(300, beside ? room : document.body.clientWidth - rect.left - 16))}px`,
    });
  }
}

/** The block of this type in the open category. */
function blockIn(workspace: Blockly.WorkspaceSvg, type: string): Element | null {
  const flyout = workspace.getFlyout();
  if (!flyout?.isVisible()) return null;
  return flyout.getWorkspace().getTopBlocks(false).find((each) => each.type === type)?.pathObject.svgPath ?? null;
}

/** The category that has a block of this type. */
function categoryOf(workspace: Blockly.WorkspaceSvg, type: string): Blockly.ToolboxCategory | null {
  for (const item of workspace.getToolbox()?.getToolboxItems() ?? []) {
    if (!(item instanceof Blockly.ToolboxCategory)) continue;
    const contents: unknown = item.getContents();
    if (Array.isArray(contents) && contents.some((each: {type?: string}) => each.type === type)) return item;
  }
  return null;
}
