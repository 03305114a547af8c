// Trying blocks at once, as in Scratch: a click on a block of the toolbox, "Run from here" for one in the behaviour.
import * as Blockly from 'blockly/core';
import {focusedBlock} from './help';
import {drawIcon} from './icons';
import {ctrl} from './keys';
import {menuIcon} from './menu';
import {takeClicked} from './sheet';
import {t} from './words';

const SVG = 'http://www.w3.org/2000/svg';
const NAME = 'nepRunFromHere';
const BESIDE = 34;
const SIDE = 26;

/** What is tried: a block of the behaviour by its id, one of the toolbox with all that it is. */
export interface Try {
  id: string;
  kind: 'value' | 'hat' | 'stack';
  state?: Blockly.serialization.blocks.State;
}

type Tell = (what: Try) => void;
let tellTry: Tell = () => undefined;

/** The block that is meant: a grey value stands for the block that holds it. */
function meant(block: Blockly.Block | null): Blockly.BlockSvg | null {
  let found = block;
  while (found?.isShadow()) found = found.getParent();
  return found instanceof Blockly.BlockSvg ? found : null;
}

/** Functions are run by what calls them. */
function canTry(block: Blockly.BlockSvg | null): block is Blockly.BlockSvg {
  return block !== null && !block.isInsertionMarker() && !block.type.startsWith('functions_define');
}

function tryBlock(block: Blockly.BlockSvg): void {
  const kind = block.outputConnection ? 'value' : block.previousConnection ? 'stack' : 'hat';
  if (!block.isInFlyout) {
    tellTry({id: block.id, kind});
    return;
  }
  const state = Blockly.serialization.blocks.save(block, {addNextBlocks: true, doFullSerialization: true, saveIds: true});
  if (state) tellTry({id: block.id, kind, state});
}

function words(block: Blockly.BlockSvg | null): string {
  return block?.outputConnection ? t('Show its value') : t('Run from here');
}

/** Once for the page: menu, key, and the click on a block of the toolbox; `tell` hears what is to be tried. */
export function registerTries(tell: Tell): void {
  tellTry = tell;
  menuIcon(NAME, 'play');
  Blockly.ContextMenuRegistry.registry.register({
    id: NAME,
    weight: 0,
    scopeType: Blockly.ContextMenuRegistry.ScopeType.BLOCK,
    displayText: (scope) => words(meant(scope.block ?? null)),
    preconditionFn: (scope) => (canTry(meant(scope.block ?? null)) ? 'enabled' : 'hidden'),
    callback: (scope) => {
      const block = meant(scope.block ?? null);
      if (block) tryBlock(block);
    },
    associatedKeyboardShortcut: NAME,
  });
  Blockly.ShortcutRegistry.registry.register({
    name: NAME,
    keyCodes: [ctrl(Blockly.utils.KeyCodes.ENTER)],
    allowCollision: true,  // with Blockly's menu, until `keys.ts` has given that its other keys
    preconditionFn: () => canTry(meant(focusedBlock())),
    callback: () => {
      const block = meant(focusedBlock());
      if (block) tryBlock(block);
      return block !== null;
    },
  });
  const gestures = Blockly.Gesture.prototype as unknown as Clicks;
  const click = gestures.doBlockClick;
  // Blockly puts a copy into the program; a person who clicks wants to see what the block does.
  gestures.doBlockClick = function (this: Clicks) {
    if (takeClicked(this.targetBlock)) return;
    const block = this.flyout ? meant(this.targetBlock) : null;
    if (canTry(block)) tryBlock(block);
    else if (!this.flyout) click.call(this);
  };
}

/** What Blockly's gesture knows of a click, by its own names. */
interface Clicks {
  flyout: Blockly.IFlyout | null;
  targetBlock: Blockly.BlockSvg | null;
  doBlockClick(this: Clicks): void;
}

/** A small round button at the left of the selected block: it runs the block and all below it. */
export class TryHandle {
  private handle: SVGGElement | null = null;
  private placing = 0;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    workspace.addChangeListener((event) => {
      if (event.type === Blockly.Events.SELECTED || this.handle) this.placeSoon();
    });
  }

  private placeSoon(): void {
    if (this.placing) return;
    this.placing = window.requestAnimationFrame(() => {
      this.placing = 0;
      this.place();
    });
  }

  private place(): void {
    const chosen = Blockly.common.getSelected();
    const block = chosen instanceof Blockly.BlockSvg && chosen.workspace === this.workspace ? chosen : null;
    if (!canTry(block) || block.isShadow() || this.workspace.isDragging()) {
      this.handle?.remove();
      this.handle = null;
      return;
    }
    this.handle ??= this.make();
    const title = this.handle.querySelector('title');
    if (title && title.textContent !== words(block)) title.textContent = words(block);
    this.handle.setAttribute('aria-label', words(block));
    const at = block.getRelativeToSurfaceXY();
    // Left of a value is what holds it: there it stands above.
    const [x, y] = block.outputConnection ? [at.x, at.y - BESIDE] : [at.x - BESIDE, at.y + 8];
    this.handle.setAttribute('transform', `translate(${x}, ${y})`);
  }

  private make(): SVGGElement {
    const group = document.createElementNS(SVG, 'g');
    group.setAttribute('class', 'nepTryHandle');
    group.setAttribute('role', 'button');
    const circle = document.createElementNS(SVG, 'circle');
    for (const name of ['cx', 'cy', 'r']) circle.setAttribute(name, String(SIDE / 2));
    const icon = document.createElementNS(SVG, 'g');
    drawIcon(icon, 'play', 14);
    icon.setAttribute('transform', 'translate(6.5, 6)');
    group.append(document.createElementNS(SVG, 'title'), circle, icon);
    // The block stays selected: the press is not the workspace's.
    group.addEventListener('pointerdown', (event) => {
      event.stopPropagation();
      event.preventDefault();
    });
    group.addEventListener('click', (event) => {
      event.stopPropagation();
      const chosen = Blockly.common.getSelected();
      if (chosen instanceof Blockly.BlockSvg && canTry(chosen)) tryBlock(chosen);
    });
    this.workspace.getBubbleCanvas().append(group);
    return group;
  }
}

/** The answer of a try beside its block, in the behaviour or in the toolbox, until the next press of anything. */
export class TryAnswer {
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

  /** Also for blocks of the toolbox, which are no part of the program: an error stands beside the toolbox and covers none. */
  say(block: Blockly.BlockSvg, sentence: string, isError: boolean): void {
    this.box.textContent = sentence;
    this.box.classList.toggle('nepTryFailed', isError);
    this.box.hidden = false;
    const place = block.getSvgRoot().querySelector(':scope > .blocklyPath') ?? block.getSvgRoot();
    const at = place.getBoundingClientRect();
    const {offsetWidth, offsetHeight} = this.box;
    const toolbox = isError && block.isInFlyout ? block.workspace.getParentSvg().getBoundingClientRect().right : 0;
    const right = Math.max(at.right, toolbox) + 12;
    const left = right + offsetWidth > window.innerWidth - 8 ? window.innerWidth - offsetWidth - 8 : right;
    const beside = left === right ? at.top + (at.height - offsetHeight) / 2 : at.bottom + 8;
    this.box.style.left = `${Math.max(8, left)}px`;
    this.box.style.top = `${Math.max(8, Math.min(beside, window.innerHeight - offsetHeight - 8))}px`;
  }

  close(): void {
    this.box.hidden = true;
  }
}
