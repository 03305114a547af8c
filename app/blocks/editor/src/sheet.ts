// Sheet at the right edge of the canvas that shows stored blocks: the bin and the backpack.
import * as Blockly from 'blockly/core';
import {Flyout} from './flyout';
import {iconElement} from './icons';
import {t} from './words';

/** Height of the footer with the buttons of the sheet, in pixels. */
const FOOTER_HEIGHT = 64;

/** Temporary flyout that closes on the next action outside it. */
export abstract class Sheet extends Flyout {
  protected override updateOverlayOffset(): void {}

  protected override readonly footerHeight = FOOTER_HEIGHT;
  protected override readonly name: string = 'nepSheet';

  /** Handles Enter or a click on a stack in the sheet. */
  abstract pick(block: Blockly.BlockSvg): void;

  /** Handles Delete on a stack in the sheet. */
  remove(_block: Blockly.BlockSvg): void {}

  /** Accessible label of the close button. */
  protected abstract get closeLabel(): string;

  override autoHide(onlyClosePopups: boolean): void {
    if (!onlyClosePopups) this.hide();
  }

  /** Turns on keyboard navigation and focuses the first stack. */
  focusFirst(): void {
    const first = this.getWorkspace().getTopBlocks(true)[0];
    if (!first) return;
    Blockly.keyboardNavigationController.setIsActive(true);
    Blockly.getFocusManager().focusNode(first);
  }

  protected override createHeaderButton(): HTMLButtonElement {
    const close = document.createElement('button');
    close.type = 'button';
    close.title = t('Close (Esc)');
    close.setAttribute('aria-label', this.closeLabel);
    close.append(iconElement('x', 16));
    close.onclick = () => this.hide();
    return close;
  }
}

const sheets = new Map<Blockly.WorkspaceSvg, Sheet>();

/** Creates a sheet for `workspace` and adds it to the page. */
export function createSheet<S extends Sheet>(workspace: Blockly.WorkspaceSvg, make: (options: Blockly.Options) => S): S {
  const options = workspace.copyOptionsForFlyout();
  options.toolboxPosition = Blockly.utils.toolbox.Position.RIGHT;
  const sheet = make(options);
  workspace.getParentSvg().after(sheet.createDom('svg'));
  sheet.init(workspace);
  sheets.set(sheet.getWorkspace(), sheet);
  return sheet;
}

export function disposeSheet(sheet: Sheet | null): void {
  if (!sheet) return;
  sheets.delete(sheet.getWorkspace());
  sheet.dispose();
}

/** Returns the sheet that contains this block. */
export function sheetOf(block: Blockly.Block | null | undefined): Sheet | null {
  return block && sheets.get(block.workspace as Blockly.WorkspaceSvg) || null;
}

/** Enter on a block in a sheet picks its stack. */
const basePerformAction = Blockly.BlockSvg.prototype.performAction;
Blockly.BlockSvg.prototype.performAction = function (this: Blockly.BlockSvg, event?: KeyboardEvent) {
  const sheet = sheetOf(this);
  if (sheet) sheet.pick(this.getRootBlock());
  else basePerformAction.call(this, event);
};

/** Picks the clicked stack; returns false if the block isn't in a sheet. */
export function activateClicked(block: Blockly.BlockSvg | null): boolean {
  const sheet = sheetOf(block);
  if (sheet && block) sheet.pick(block.getRootBlock());
  return sheet !== null;
}

/** A click on a field in a sheet picks the stack too: stored blocks can't be edited. */
const baseIsClickableInFlyout = Blockly.Field.prototype.isClickableInFlyout;
Blockly.Field.prototype.isClickableInFlyout = function (this: Blockly.Field, isAutoClosing: boolean) {
  return !sheetOf(this.getSourceBlock()) && baseIsClickableInFlyout.call(this, isAutoClosing);
};
