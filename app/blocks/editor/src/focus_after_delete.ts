// Where the keys go when the block that had them is deleted: to a place that Delete cannot remove. Blockly gives them
// to the next block, and a second Delete by an unsure finger takes that away as well.
import * as Blockly from 'blockly/core';

/** The block that has the keys, itself or by a field or gap of it. */
function focusedSource(): Blockly.Block | null {
  const node = Blockly.getFocusManager().getFocusedNode();
  if (node instanceof Blockly.BlockSvg) return node;
  return node instanceof Blockly.Field || node instanceof Blockly.RenderedConnection ? node.getSourceBlock() : null;
}

/** Whether the block is `top` or inside of it; what hangs below `top` stays when a stack is healed. */
function isWithin(block: Blockly.Block | null, top: Blockly.Block): boolean {
  for (let each = block; each; each = each.getParent()) if (each === top) return true;
  return false;
}

/** Somebody who goes by keys stays at the place where the block was; for the mouse nothing is selected any more. */
function placeAfter(block: Blockly.BlockSvg): Blockly.IFocusableNode {
  const {workspace} = block;
  const root = workspace.getWorkspaceFocusTarget() ?? workspace;
  const gap = (block.previousConnection ?? block.outputConnection)?.targetConnection;
  return gap && Blockly.keyboardNavigationController.getIsActive() ? gap as Blockly.RenderedConnection : root;
}

const dispose = Blockly.BlockSvg.prototype.dispose;
Blockly.BlockSvg.prototype.dispose = function (this: Blockly.BlockSvg, heal?: boolean, animate?: boolean) {
  const {workspace} = this;
  const leaves = !workspace.isFlyout && !workspace.isClearing && !this.isInsertionMarker() &&
    isWithin(focusedSource(), this);
  const place = leaves ? placeAfter(this) : null;
  dispose.call(this, heal, animate);
  // After Blockly's own choice, which comes with a timeout as well.
  if (place) window.setTimeout(() => take(place, workspace));
};

function take(place: Blockly.IFocusableNode, workspace: Blockly.WorkspaceSvg): void {
  if (!workspace.rendered || !workspace.getInjectionDiv().contains(document.activeElement)) return;
  const manager = Blockly.getFocusManager();
  const gone = place instanceof Blockly.RenderedConnection && place.getSourceBlock().isDeadOrDying();
  manager.focusNode(gone || !place.canBeFocused() ? workspace : place);
}
