// Performance patches: work that Blockly repeats, noticeable with a thousand blocks, is cached or deferred.
import * as Blockly from 'blockly/core';
import {ensureDrawn} from './culling';

const SVG_NS = 'http://www.w3.org/2000/svg';

// ---- moving an element without losing the focus

interface WithMoveBefore {
  moveBefore?(node: Node, child: Node | null): void;
}

/**
 * Moves a connected element with `moveBefore()` where the browser has it (since 2025), which preserves the
 * focus. Re-inserting a block loses the focus; Blockly then restores it and forces a layout each time, five
 * times per drop.
 */
const originalAppendChild = SVGElement.prototype.appendChild;
SVGElement.prototype.appendChild = function <T extends Node>(this: SVGElement & WithMoveBefore, child: T): T {
  if (child.isConnected && this.moveBefore && this.isConnected) {
    this.moveBefore(child, null);
    return child;
  }
  return originalAppendChild.call(this, child) as T;
};

/**
 * The same for `insertBefore()`. Before the next frame Blockly reorders overlapping blocks one by one; several
 * pastes within one frame (a held key) would lose the focus with the newest copy.
 */
const originalInsertBefore = SVGElement.prototype.insertBefore;
SVGElement.prototype.insertBefore = function <T extends Node>(this: SVGElement & WithMoveBefore, child: T, before: Node | null): T {
  if (child.isConnected && this.moveBefore && this.isConnected) {
    this.moveBefore(child, before);
    return child;
  }
  return originalInsertBefore.call(this, child, before) as T;
};

// ---- keyboard focus

interface FocusManagerInternals {
  focusNode(node: Blockly.IFocusableNode): void;
  setNodeToVisualActiveFocus(node: Blockly.IFocusableNode): void;
  setNodeToVisualPassiveFocus(node: Blockly.IFocusableNode): void;
}

/** Elements that have or had one of Blockly's focus classes. Blockly searches the whole page for them. */
const markedElements = new Set<Element>();
const FOCUS_CLASSES = [Blockly.FocusManager.ACTIVE_FOCUS_NODE_CSS_CLASS_NAME,
  Blockly.FocusManager.PASSIVE_FOCUS_NODE_CSS_CLASS_NAME];

const focusManager = Blockly.FocusManager.prototype as unknown as FocusManagerInternals;
for (const name of ['setNodeToVisualActiveFocus', 'setNodeToVisualPassiveFocus'] as const) {
  const mark = focusManager[name];
  focusManager[name] = function (node) {
    markedElements.add(node.getFocusableElement());
    mark.call(this, node);
  };
}

const originalFocusNode = focusManager.focusNode;
focusManager.focusNode = function (node) {
  const element = node.canBeFocused() ? node.getFocusableElement() : null;
  ensureDrawn(element);  // only a rendered element can have the focus
  if (node instanceof Blockly.Field && pendingAria.delete(node as AriaTarget)) node.recomputeAriaContext();
  originalFocusNode.call(this, node);
};

Blockly.FocusableTreeTraverser.findFocusedNode = function (tree) {
  const root = tree.getRootFocusableNode();
  if (!root.canBeFocused()) return null;
  const top = root.getFocusableElement();
  if (FOCUS_CLASSES.some((mark) => top.classList.contains(mark))) return root;
  for (const mark of FOCUS_CLASSES) {
    for (const element of markedElements) {
      if (!element.isConnected || !FOCUS_CLASSES.some((className) => element.classList.contains(className))) markedElements.delete(element);
      else if (element.classList.contains(mark) && top.contains(element)) {
        const node = this.findFocusableNodeFor(element as SVGElement, tree);
        if (node) return node;
      }
    }
  }
  return null;
};

/** Finds a block by its element instead of checking every block as Blockly does. */
const originalLookUpFocusableNode = Blockly.WorkspaceSvg.prototype.lookUpFocusableNode;
Blockly.WorkspaceSvg.prototype.lookUpFocusableNode = function (id) {
  if (!/_(field|connection)_/.test(id)) {
    const blockId = document.getElementById(id)?.parentElement?.dataset['id'];
    const block = blockId === undefined ? null : this.getBlockById(blockId);
    if (block?.getFocusableElement().id === id) return block;
  }
  return originalLookUpFocusableNode.call(this, id);
};

// ---- position of a new block that was added by keyboard and isn't connected

/** Distance from the edge in workspace units; fits the signs at the left of a block, which are 20 wide. */
const NEW_BLOCK_MARGIN = 48;

interface BlockDragStrategyInternals {
  WORKSPACE_MARGIN: number;
  positionNewBlock(from: Blockly.BlockSvg, newBlock: Blockly.BlockSvg): void;
}
const dragStrategy = Blockly.dragging.BlockDragStrategy.prototype as unknown as BlockDragStrategyInternals;
const originalPositionNewBlock = dragStrategy.positionNewBlock;
dragStrategy.positionNewBlock = function (from, newBlock) {
  this.WORKSPACE_MARGIN = NEW_BLOCK_MARGIN;
  originalPositionNewBlock.call(this, from, newBlock);
};

// ---- width of text

interface FieldInternals {
  textElement_: SVGTextElement | null;
  updateSize_(margin?: number): void;
}

/** Font of each CSS class of text, cached while blocks are loaded. */
const fonts = new Map<string, {size: string; weight: string; family: string}>();

/**
 * Reads the font once per class and load. Blockly calls getComputedStyle() for each new text, which recalculates
 * the style of all added elements; measured widths are in Blockly's own cache afterwards.
 */
const fieldPrototype = Blockly.Field.prototype as unknown as FieldInternals;
const originalUpdateSize = fieldPrototype.updateSize_;
fieldPrototype.updateSize_ = function (margin) {
  const text = this.textElement_;
  if (deferDepth && text?.isConnected) {
    const name = text.className.baseVal;
    const {size, weight, family} = fonts.get(name) ?? fontOf(text);
    fonts.set(name, {size, weight, family});
    Blockly.utils.dom.getFastTextWidthWithSizeString(text, size, weight, family);
  }
  originalUpdateSize.call(this, margin);
};

function fontOf(text: SVGTextElement): {size: string; weight: string; family: string} {
  const {fontSize, fontWeight, fontFamily} = window.getComputedStyle(text);
  return {size: fontSize, weight: fontWeight, family: fontFamily};
}

// ---- labels for screen readers

type AriaTarget = (Blockly.Field | Blockly.BlockSvg) & HasAriaContext;

/** Method of blocks that Blockly doesn't export. */
interface HasAriaContext {
  recomputeAriaContext(): boolean | void;
}

/** Targets whose ARIA labels are pending: computed when the page is idle, or when the target gets the focus. */
const pendingAria = new Set<AriaTarget>();
let deferDepth = 0;

/** Defers ARIA labels and caches fonts while `load` creates blocks. */
export function withDeferredAria<T>(load: () => T): T {
  deferDepth += 1;
  try {
    return load();
  } finally {
    deferDepth -= 1;
    if (!deferDepth) {
      fonts.clear();
      scheduleAriaUpdate();
    }
  }
}

const SLICE_MS = 5;
const GESTURE_RETRY_MS = 300;

function scheduleAriaUpdate(): void {
  if (pendingAria.size) window.requestIdleCallback(updatePendingAria, {timeout: 1000});
}

function updatePendingAria(idle: IdleDeadline): void {
  if (Blockly.Gesture.inProgress()) {  // never delay a drag
    window.setTimeout(scheduleAriaUpdate, GESTURE_RETRY_MS);
    return;
  }
  const startTime = performance.now();
  for (const target of pendingAria) {
    if (deferDepth) return;
    pendingAria.delete(target);
    const block = target instanceof Blockly.Field ? target.getSourceBlock() : target;
    if (block && !block.isDeadOrDying()) target.recomputeAriaContext();
    if (performance.now() - startTime > Math.min(SLICE_MS, Math.max(1, idle.timeRemaining()))) break;
  }
  scheduleAriaUpdate();
}

const recomputeFieldAria = Blockly.Field.prototype.recomputeAriaContext;
Blockly.Field.prototype.recomputeAriaContext = function () {
  if (!this.getSvgRoot()) return false;  // before the field is rendered, Blockly throws an error here and catches it
  if (!deferDepth) return recomputeFieldAria.call(this);
  pendingAria.add(this);
  return false;
};

const blockPrototype = Blockly.BlockSvg.prototype as unknown as HasAriaContext;
const recomputeBlockAria = blockPrototype.recomputeAriaContext;
blockPrototype.recomputeAriaContext = function () {
  if (deferDepth) pendingAria.add(this as AriaTarget);
  else recomputeBlockAria.call(this);
};

// ---- arrow of drop-downs: a path instead of Blockly's image, which is fetched and decoded for each field

const ARROW_PATH = 'M6 9.21a1.35 1.35 0 0 1-.94-.4L1.34 5.11a1.36 1.36 0 0 1 0-1.89c.53-.53 8.79-.53 9.32 0a1.36 1.36 0 0 1' +
  ' 0 1.89L6.96 8.81A1.35 1.35 0 0 1 6 9.21Z';

interface DropdownInternals {
  svgArrow: SVGElement | null;
  fieldGroup_: SVGGElement | null;
  createSVGArrow_(this: DropdownInternals): void;
}
(Blockly.FieldDropdown.prototype as unknown as DropdownInternals).createSVGArrow_ = function () {
  this.svgArrow = document.createElementNS(SVG_NS, 'path');
  this.svgArrow.setAttribute('class', 'nepArrow');
  this.svgArrow.setAttribute('d', ARROW_PATH);
  this.fieldGroup_?.append(this.svgArrow);
};

// ---- shadow blocks of empty inputs: saved as JSON only; Blockly writes XML as well, which is never read

interface ConnectionInternals {
  shadowState: unknown;
  shadowDom: unknown;
  serializeShadow(this: ConnectionInternals, shadow: Blockly.Block | null): void;
}
(Blockly.Connection.prototype as unknown as ConnectionInternals).serializeShadow = function (shadow) {
  if (!shadow) return;
  this.shadowDom = null;
  this.shadowState = Blockly.serialization.blocks.save(shadow);
};
