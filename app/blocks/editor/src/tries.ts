// Runs single blocks, as in Scratch: a click on a block of the toolbox, or “Run from here” in the workspace.
import * as Blockly from 'blockly/core';
import {send} from './channel';
import {focusedBlock} from './help';
import {drawIcon} from './icons';
import {ctrl} from './keys';
import {setMenuIcon} from './menu';
import {activateClicked} from './sheet';
import {t} from './words';

const SVG_NS = 'http://www.w3.org/2000/svg';
const MENU_ITEM_ID = 'nepRunFromHere';
const HANDLE_DISTANCE = 34;
const HANDLE_SIZE = 26;

/** Returns the block itself, or the nearest parent that isn't a shadow block. */
function getNonShadowBlock(block: Blockly.Block | null): Blockly.BlockSvg | null {
  let current = block;
  while (current?.isShadow()) current = current.getParent();
  return current instanceof Blockly.BlockSvg ? current : null;
}

/** Returns true if the block can be run; function definitions can't, only their calls. */
function canTry(block: Blockly.BlockSvg | null): block is Blockly.BlockSvg {
  return block !== null && !block.isInsertionMarker() && !block.type.startsWith('functions_define');
}

function tryBlock(block: Blockly.BlockSvg): void {
  const kind = block.outputConnection ? 'value' : block.previousConnection ? 'stack' : 'hat';
  if (!block.isInFlyout) {
    send({type: 'stackTried', id: block.id, kind, state: null});
    return;
  }
  const state = Blockly.serialization.blocks.save(block, {addNextBlocks: true, doFullSerialization: true, saveIds: true});
  if (state) send({type: 'stackTried', id: block.id, kind, state: {...state}});
}

function actionLabel(block: Blockly.BlockSvg | null): string {
  return block?.outputConnection ? t('Show value') : t('Run from here');
}

/** Registers the menu entry, shortcut and toolbox click, once per page. */
export function registerTries(): void {
  setMenuIcon(MENU_ITEM_ID, 'play');
  Blockly.ContextMenuRegistry.registry.register({
    id: MENU_ITEM_ID,
    weight: 0,
    scopeType: Blockly.ContextMenuRegistry.ScopeType.BLOCK,
    displayText: (scope) => actionLabel(getNonShadowBlock(scope.block ?? null)),
    preconditionFn: (scope) => (canTry(getNonShadowBlock(scope.block ?? null)) ? 'enabled' : 'hidden'),
    callback: (scope) => {
      const block = getNonShadowBlock(scope.block ?? null);
      if (block) tryBlock(block);
    },
    associatedKeyboardShortcut: MENU_ITEM_ID,
  });
  Blockly.ShortcutRegistry.registry.register({
    name: MENU_ITEM_ID,
    keyCodes: [ctrl(Blockly.utils.KeyCodes.ENTER)],
    allowCollision: true,  // with Blockly's context menu, until `keys.ts` assigns that other keys
    preconditionFn: () => canTry(getNonShadowBlock(focusedBlock())),
    callback: () => {
      const block = getNonShadowBlock(focusedBlock());
      if (block) tryBlock(block);
      return block !== null;
    },
  });
  const gestures = Blockly.Gesture.prototype as unknown as ClickGesture;
  const click = gestures.doBlockClick;
  // Blockly adds a copy of a clicked toolbox block to the workspace; run the block instead.
  gestures.doBlockClick = function (this: ClickGesture) {
    if (activateClicked(this.targetBlock)) return;
    const block = this.flyout ? getNonShadowBlock(this.targetBlock) : null;
    if (canTry(block)) tryBlock(block);
    else if (!this.flyout) click.call(this);
  };
}

/** Private members of Blockly's gesture that handle a click. */
interface ClickGesture {
  flyout: Blockly.IFlyout | null;
  targetBlock: Blockly.BlockSvg | null;
  doBlockClick(this: ClickGesture): void;
}

/** Round button to the left of the selected block that runs the block and all blocks below it. */
export class TryHandle {
  private handle: SVGGElement | null = null;
  private placing = 0;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    workspace.addChangeListener((event) => {
      if (event.type === Blockly.Events.SELECTED || this.handle) this.scheduleUpdate();
    });
  }

  private scheduleUpdate(): void {
    if (this.placing) return;
    this.placing = window.requestAnimationFrame(() => {
      this.placing = 0;
      this.update();
    });
  }

  private update(): void {
    const selected = Blockly.common.getSelected();
    const block = selected instanceof Blockly.BlockSvg && selected.workspace === this.workspace ? selected : null;
    if (!canTry(block) || block.isShadow() || this.workspace.isDragging()) {
      this.handle?.remove();
      this.handle = null;
      return;
    }
    this.handle ??= this.createHandle();
    const title = this.handle.querySelector('title');
    if (title && title.textContent !== actionLabel(block)) title.textContent = actionLabel(block);
    this.handle.setAttribute('aria-label', actionLabel(block));
    const position = block.getRelativeToSurfaceXY();
    // A value has its parent block on the left, so the button is placed above it.
    const [x, y] = block.outputConnection ? [position.x, position.y - HANDLE_DISTANCE] : [position.x - HANDLE_DISTANCE, position.y + 8];
    this.handle.setAttribute('transform', `translate(${x}, ${y})`);
  }

  private createHandle(): SVGGElement {
    const group = document.createElementNS(SVG_NS, 'g');
    group.setAttribute('class', 'nepTryHandle');
    group.setAttribute('role', 'button');
    const circle = document.createElementNS(SVG_NS, 'circle');
    for (const name of ['cx', 'cy', 'r']) circle.setAttribute(name, String(HANDLE_SIZE / 2));
    const icon = document.createElementNS(SVG_NS, 'g');
    drawIcon(icon, 'play', 14);
    icon.setAttribute('transform', 'translate(6.5, 6)');
    group.append(document.createElementNS(SVG_NS, 'title'), circle, icon);
    // Keep the workspace from handling the press and clearing the selection.
    group.addEventListener('pointerdown', (event) => {
      event.stopPropagation();
      event.preventDefault();
    });
    group.addEventListener('click', (event) => {
      event.stopPropagation();
      const selected = Blockly.common.getSelected();
      if (selected instanceof Blockly.BlockSvg && canTry(selected)) tryBlock(selected);
    });
    this.workspace.getBubbleCanvas().append(group);
    return group;
  }
}

/** Shows the result of a run next to its block until the next click, key press or scroll. */
export class TryResult {
  private readonly box = document.createElement('div');

  constructor() {
    this.box.setAttribute('role', 'status');
    this.box.className = 'nepTryAnswer';
    this.box.hidden = true;
    document.body.append(this.box);
    for (const name of ['pointerdown', 'keydown', 'wheel']) {
      document.addEventListener(name, () => this.close(), {capture: true, passive: true});
    }
  }

  /** Shows the text next to the block; an error of a toolbox block goes beside the flyout to cover no blocks. */
  show(block: Blockly.BlockSvg, text: string, isError: boolean): void {
    this.box.textContent = text;
    this.box.classList.toggle('nepTryFailed', isError);
    this.box.hidden = false;
    const anchor = block.getSvgRoot().querySelector(':scope > .blocklyPath') ?? block.getSvgRoot();
    const rect = anchor.getBoundingClientRect();
    const {offsetWidth, offsetHeight} = this.box;
    const toolbox = isError && block.isInFlyout ? block.workspace.getParentSvg().getBoundingClientRect().right : 0;
    const right = Math.max(rect.right, toolbox) + 12;
    const left = right + offsetWidth > window.innerWidth - 8 ? window.innerWidth - offsetWidth - 8 : right;
    const top = left === right ? rect.top + (rect.height - offsetHeight) / 2 : rect.bottom + 8;
    this.box.style.left = `${Math.max(8, left)}px`;
    this.box.style.top = `${Math.max(8, Math.min(top, window.innerHeight - offsetHeight - 8))}px`;
  }

  close(): void {
    this.box.hidden = true;
  }
}
