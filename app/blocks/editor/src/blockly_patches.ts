// Where Blockly does work again and again that a page with a thousand blocks feels, done once or later.
import * as Blockly from 'blockly/core';
import {ensureDrawn} from './culling';

const SVG_NS = 'http://www.w3.org/2000/svg';

// ---- moving a block in the page keeps the keys on it

interface WithMoveBefore {
  moveBefore?(node: Node, child: Node | null): void;
}

/**
 * A block that is put elsewhere in the page loses the keys, so Blockly gives them back, and each time the page is
 * laid out at once: five times for one drop. A web engine that can move an element as it is (since 2025) need not.
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
 * Before the next picture Blockly puts what lies over a block below it, one by one. Who copies several times within
 * one picture, by a key that is held, would lose the keys with the newest copy.
 */
const originalInsertBefore = SVGElement.prototype.insertBefore;
SVGElement.prototype.insertBefore = function <T extends Node>(this: SVGElement & WithMoveBefore, child: T, before: Node | null): T {
  if (child.isConnected && this.moveBefore && this.isConnected) {
    this.moveBefore(child, before);
    return child;
  }
  return originalInsertBefore.call(this, child, before) as T;
};

// ---- who has the keys

interface FocusManagerInternals {
  focusNode(node: Blockly.IFocusableNode): void;
  setNodeToVisualActiveFocus(node: Blockly.IFocusableNode): void;
  setNodeToVisualPassiveFocus(node: Blockly.IFocusableNode): void;
}

/** The elements that carry one of Blockly's two marks, or did. Blockly looks through the whole page for them. */
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
  ensureDrawn(element);  // what is not drawn cannot have the keys
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

/** Blockly asks each block whether the element is its own. */
const originalLookUpFocusableNode = Blockly.WorkspaceSvg.prototype.lookUpFocusableNode;
Blockly.WorkspaceSvg.prototype.lookUpFocusableNode = function (id) {
  if (!/_(field|connection)_/.test(id)) {
    const blockId = document.getElementById(id)?.parentElement?.dataset['id'];
    const block = blockId === undefined ? null : this.getBlockById(blockId);
    if (block?.getFocusableElement().id === id) return block;
  }
  return originalLookUpFocusableNode.call(this, id);
};

// ---- a block that is taken with the keys and hangs on nothing lies as far from the edge as a hand would put it

/** The signs at the left of a block are 20 wide. */
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

// ---- the width of words

interface FieldInternals {
  textElement_: SVGTextElement | null;
  updateSize_(margin?: number): void;
}

/** While blocks are loaded: the font of each class of text. */
const fonts = new Map<string, {size: string; weight: string; family: string}>();

/**
 * Blockly asks for the style of each new text, and each time the page works out anew the styles of all that was added.
 * All text of a class has one font, so it is asked once a load; what was measured is in Blockly's own cache then.
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

// ---- words for screen readers

type AriaTarget = (Blockly.Field | Blockly.BlockSvg) & HasAriaContext;

/** Blockly keeps a block's to itself. */
interface HasAriaContext {
  recomputeAriaContext(): boolean | void;
}

/** Those whose words are not made yet: they are when nothing else is to be done, or when the keys come to them. */
const pendingAria = new Set<AriaTarget>();
let deferDepth = 0;

/** While `load` makes blocks, their words for screen readers wait and the fonts of texts are asked once. */
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
  if (Blockly.Gesture.inProgress()) {  // nothing comes between a hand and its block
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
  if (!this.getSvgRoot()) return false;  // before it is drawn Blockly throws an error here, and catches it
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

// ---- the arrow of a drop-down, a picture of its own in Blockly, which the page fetches and decodes for each

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

// ---- what a gap offers when it is empty: as JSON only, Blockly writes XML as well that nobody reads

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
