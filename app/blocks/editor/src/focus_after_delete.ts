// Where the keys go when the block that had them is deleted: to a place that Delete cannot remove. Blockly gives them
// to the next block, and a second Delete by an unsure finger takes that away as well.
import * as Blockly from 'blockly/core';

/** The block that has the keys, itself or by a field or gap of it. */
function focusedSourceBlock(): Blockly.Block | null {
  const node = Blockly.getFocusManager().getFocusedNode();
  if (node instanceof Blockly.BlockSvg) return node;
  return node instanceof Blockly.Field || node instanceof Blockly.RenderedConnection ? node.getSourceBlock() : null;
}

/** Whether the block is `top` or inside of it; what hangs below `top` stays when a stack is healed. */
function isWithin(block: Blockly.Block | null, top: Blockly.Block): boolean {
  for (let ancestor = block; ancestor; ancestor = ancestor.getParent()) if (ancestor === top) return true;
  return false;
}

/** Somebody who goes by keys stays at the place where the block was; for the mouse nothing is selected any more. */
function fallbackFocusNode(block: Blockly.BlockSvg): Blockly.IFocusableNode {
  const {workspace} = block;
  const root = workspace.getWorkspaceFocusTarget() ?? workspace;
  const gap = (block.previousConnection ?? block.outputConnection)?.targetConnection;
  return gap && Blockly.keyboardNavigationController.getIsActive() ? gap as Blockly.RenderedConnection : root;
}

const originalDispose = Blockly.BlockSvg.prototype.dispose;
Blockly.BlockSvg.prototype.dispose = function (this: Blockly.BlockSvg, heal?: boolean, animate?: boolean) {
  const {workspace} = this;
  const leaves = !workspace.isFlyout && !workspace.isClearing && !this.isInsertionMarker() &&
    isWithin(focusedSourceBlock(), this);
  const nextFocus = leaves ? fallbackFocusNode(this) : null;
  originalDispose.call(this, heal, animate);
  // After Blockly's own choice, which comes with a timeout as well.
  if (nextFocus) window.setTimeout(() => moveFocus(nextFocus, workspace));
};

function moveFocus(node: Blockly.IFocusableNode, workspace: Blockly.WorkspaceSvg): void {
  if (!workspace.rendered || !workspace.getInjectionDiv().contains(document.activeElement)) return;
  const manager = Blockly.getFocusManager();
  const isDisposed = node instanceof Blockly.RenderedConnection && node.getSourceBlock().isDeadOrDying();
  manager.focusNode(isDisposed || !node.canBeFocused() ? workspace : node);
}
