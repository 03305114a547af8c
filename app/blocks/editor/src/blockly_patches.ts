// Where Blockly does work again and again that a page with a thousand blocks feels, done once or later.
import * as Blockly from 'blockly/core';
import {drawNow} from './culling';

const SVG = 'http://www.w3.org/2000/svg';

// ---- moving a block in the page keeps the keys on it

interface Moves {
  moveBefore?(node: Node, child: Node | null): void;
}

/**
 * A block that is put elsewhere in the page loses the keys, so Blockly gives them back, and each time the page is
 * laid out at once: five times for one drop. A web engine that can move an element as it is (since 2025) need not.
 */
const append = SVGElement.prototype.appendChild;
SVGElement.prototype.appendChild = function <T extends Node>(this: SVGElement & Moves, child: T): T {
  if (child.isConnected && this.moveBefore && this.isConnected) {
    this.moveBefore(child, null);
    return child;
  }
  return append.call(this, child) as T;
};

/**
 * Before the next picture Blockly puts what lies over a block below it, one by one. Who copies several times within
 * one picture, by a key that is held, would lose the keys with the newest copy.
 */
const insert = SVGElement.prototype.insertBefore;
SVGElement.prototype.insertBefore = function <T extends Node>(this: SVGElement & Moves, child: T, before: Node | null): T {
  if (child.isConnected && this.moveBefore && this.isConnected) {
    this.moveBefore(child, before);
    return child;
  }
  return insert.call(this, child, before) as T;
};

// ---- who has the keys

interface Marks {
  focusNode(node: Blockly.IFocusableNode): void;
  setNodeToVisualActiveFocus(node: Blockly.IFocusableNode): void;
  setNodeToVisualPassiveFocus(node: Blockly.IFocusableNode): void;
}

/** The elements that carry one of Blockly's two marks, or did. Blockly looks through the whole page for them. */
const marked = new Set<Element>();
const MARKS = [Blockly.FocusManager.ACTIVE_FOCUS_NODE_CSS_CLASS_NAME,
  Blockly.FocusManager.PASSIVE_FOCUS_NODE_CSS_CLASS_NAME];

const manager = Blockly.FocusManager.prototype as unknown as Marks;
for (const name of ['setNodeToVisualActiveFocus', 'setNodeToVisualPassiveFocus'] as const) {
  const mark = manager[name];
  manager[name] = function (node) {
    marked.add(node.getFocusableElement());
    mark.call(this, node);
  };
}

const focusNode = manager.focusNode;
manager.focusNode = function (node) {
  const element = node.canBeFocused() ? node.getFocusableElement() : null;
  drawNow(element);  // what is not drawn cannot have the keys
  if (node instanceof Blockly.Field && later.delete(node as Told)) node.recomputeAriaContext();
  focusNode.call(this, node);
};

Blockly.FocusableTreeTraverser.findFocusedNode = function (tree) {
  const root = tree.getRootFocusableNode();
  if (!root.canBeFocused()) return null;
  const top = root.getFocusableElement();
  if (MARKS.some((mark) => top.classList.contains(mark))) return root;
  for (const mark of MARKS) {
    for (const element of marked) {
      if (!element.isConnected || !MARKS.some((each) => element.classList.contains(each))) marked.delete(element);
      else if (element.classList.contains(mark) && top.contains(element)) {
        const node = this.findFocusableNodeFor(element as SVGElement, tree);
        if (node) return node;
      }
    }
  }
  return null;
};

/** Blockly asks each block whether the element is its own. */
const lookUp = Blockly.WorkspaceSvg.prototype.lookUpFocusableNode;
Blockly.WorkspaceSvg.prototype.lookUpFocusableNode = function (id) {
  if (!/_(field|connection)_/.test(id)) {
    const holder = document.getElementById(id)?.parentElement?.dataset['id'];
    const block = holder === undefined ? null : this.getBlockById(holder);
    if (block?.getFocusableElement().id === id) return block;
  }
  return lookUp.call(this, id);
};

// ---- a block that is taken with the keys and hangs on nothing lies as far from the edge as a hand would put it

/** The signs at the left of a block are 20 wide. */
const FROM_EDGE = 48;

interface Placing {
  WORKSPACE_MARGIN: number;
  positionNewBlock(from: Blockly.BlockSvg, made: Blockly.BlockSvg): void;
}
const placing = Blockly.dragging.BlockDragStrategy.prototype as unknown as Placing;
const place = placing.positionNewBlock;
placing.positionNewBlock = function (from, made) {
  this.WORKSPACE_MARGIN = FROM_EDGE;
  place.call(this, from, made);
};

// ---- the width of words

interface Sized {
  textElement_: SVGTextElement | null;
  updateSize_(margin?: number): void;
}

/** While blocks are loaded: the font of each class of text. */
const fonts = new Map<string, {size: string; weight: string; family: string}>();

/**
 * Blockly asks for the style of each new text, and each time the page works out anew the styles of all that was added.
 * All text of a class has one font, so it is asked once a load; what was measured is in Blockly's own cache then.
 */
const field = Blockly.Field.prototype as unknown as Sized;
const updateSize = field.updateSize_;
field.updateSize_ = function (margin) {
  const text = this.textElement_;
  if (holding && text?.isConnected) {
    const name = text.className.baseVal;
    const {size, weight, family} = fonts.get(name) ?? fontOf(text);
    fonts.set(name, {size, weight, family});
    Blockly.utils.dom.getFastTextWidthWithSizeString(text, size, weight, family);
  }
  updateSize.call(this, margin);
};

function fontOf(text: SVGTextElement): {size: string; weight: string; family: string} {
  const {fontSize, fontWeight, fontFamily} = window.getComputedStyle(text);
  return {size: fontSize, weight: fontWeight, family: fontFamily};
}

// ---- words for screen readers

type Told = (Blockly.Field | Blockly.BlockSvg) & Tells;

/** Blockly keeps a block's to itself. */
interface Tells {
  recomputeAriaContext(): boolean | void;
}

/** Those whose words are not made yet: they are when nothing else is to be done, or when the keys come to them. */
const later = new Set<Told>();
let holding = 0;

/** While `load` makes blocks, their words for screen readers wait and the fonts of texts are asked once. */
export function withDeferredWords<T>(load: () => T): T {
  holding += 1;
  try {
    return load();
  } finally {
    holding -= 1;
    if (!holding) {
      fonts.clear();
      tellLater();
    }
  }
}

const PIECE_MS = 5;
const HAND_MS = 300;

function tellLater(): void {
  if (later.size) window.requestIdleCallback(tellSome, {timeout: 1000});
}

function tellSome(idle: IdleDeadline): void {
  if (Blockly.Gesture.inProgress()) {  // nothing comes between a hand and its block
    window.setTimeout(tellLater, HAND_MS);
    return;
  }
  const began = performance.now();
  for (const each of later) {
    if (holding) return;
    later.delete(each);
    const block = each instanceof Blockly.Field ? each.getSourceBlock() : each;
    if (block && !block.isDeadOrDying()) each.recomputeAriaContext();
    if (performance.now() - began > Math.min(PIECE_MS, Math.max(1, idle.timeRemaining()))) break;
  }
  tellLater();
}

const tellField = Blockly.Field.prototype.recomputeAriaContext;
Blockly.Field.prototype.recomputeAriaContext = function () {
  if (!this.getSvgRoot()) return false;  // before it is drawn Blockly throws an error here, and catches it
  if (!holding) return tellField.call(this);
  later.add(this);
  return false;
};

const blocks = Blockly.BlockSvg.prototype as unknown as Tells;
const tellBlock = blocks.recomputeAriaContext;
blocks.recomputeAriaContext = function () {
  if (holding) later.add(this as Told);
  else tellBlock.call(this);
};

// ---- the arrow of a drop-down, a picture of its own in Blockly, which the page fetches and decodes for each

const ARROW = 'M6 9.21a1.35 1.35 0 0 1-.94-.4L1.34 5.11a1.36 1.36 0 0 1 0-1.89c.53-.53 8.79-.53 9.32 0a1.36 1.36 0 0 1' +
  ' 0 1.89L6.96 8.81A1.35 1.35 0 0 1 6 9.21Z';

interface HasArrow {
  svgArrow: SVGElement | null;
  fieldGroup_: SVGGElement | null;
  createSVGArrow_(this: HasArrow): void;
}
(Blockly.FieldDropdown.prototype as unknown as HasArrow).createSVGArrow_ = function () {
  this.svgArrow = document.createElementNS(SVG, 'path');
  this.svgArrow.setAttribute('class', 'nepArrow');
  this.svgArrow.setAttribute('d', ARROW);
  this.fieldGroup_?.append(this.svgArrow);
};

// ---- what a gap offers when it is empty: as JSON only, Blockly writes XML as well that nobody reads

interface KeepsShadow {
  shadowState: unknown;
  shadowDom: unknown;
  serializeShadow(this: KeepsShadow, shadow: Blockly.Block | null): void;
}
(Blockly.Connection.prototype as unknown as KeepsShadow).serializeShadow = function (shadow) {
  if (!shadow) return;
  this.shadowDom = null;
  this.shadowState = Blockly.serialization.blocks.save(shadow);
};
