// Focus after the focused block was deleted: moves to a node that Delete can't remove. Blockly focuses the
// next block, which an accidental second Delete would remove as well.
import * as Blockly from 'blockly/core';

/** Returns the focused block; a focused field or slot counts as its block. */
function focusedSourceBlock(): Blockly.Block | null {
  const node = Blockly.getFocusManager().getFocusedNode();
  if (node instanceof Blockly.BlockSvg) return node;
  return node instanceof Blockly.Field || node instanceof Blockly.RenderedConnection ? node.getSourceBlock() : null;
}

/** Returns true if the block is `top` or a descendant of it. */
function isWithin(block: Blockly.Block | null, top: Blockly.Block): boolean {
  for (let ancestor = block; ancestor; ancestor = ancestor.getParent()) if (ancestor === top) return true;
  return false;
}

/** Returns the connection where the block was if the keyboard is in use, otherwise the workspace. */
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
  // Blockly moves the focus in a timeout as well; ours has to run after it.
  if (nextFocus) window.setTimeout(() => moveFocus(nextFocus, workspace));
};

function moveFocus(node: Blockly.IFocusableNode, workspace: Blockly.WorkspaceSvg): void {
  if (!workspace.rendered || !workspace.getInjectionDiv().contains(document.activeElement)) return;
  const manager = Blockly.getFocusManager();
  const isDisposed = node instanceof Blockly.RenderedConnection && node.getSourceBlock().isDeadOrDying();
  manager.focusNode(isDisposed || !node.canBeFocused() ? workspace : node);
}
