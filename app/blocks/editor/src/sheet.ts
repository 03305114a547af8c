// A sheet at the right of the canvas with blocks that wait there: those in the bin, those in the backpack.
import * as Blockly from 'blockly/core';
import {Flyout} from './flyout';
import {iconElement} from './icons';
import {t} from './words';

/** Room for the buttons below the sheet. */
const FOOTER_HEIGHT = 64;

/** A sheet is open for a moment only: it closes with the next thing that is done elsewhere. */
export abstract class Sheet extends Flyout {
  protected override updateOverlayOffset(): void {}

  protected override readonly footerHeight = FOOTER_HEIGHT;
  protected override readonly name: string = 'nepSheet';

  /** What Enter or a click on a stack of blocks in it does. */
  abstract pick(block: Blockly.BlockSvg): void;

  /** What Delete on it does. */
  remove(_block: Blockly.BlockSvg): void {}

  /** What its close button is called. */
  protected abstract get closes(): string;

  override autoHide(onlyClosePopups: boolean): void {
    if (!onlyClosePopups) this.hide();
  }

  /** The keys go to its first stack, if they are led by keys. */
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
    close.setAttribute('aria-label', this.closes);
    close.append(iconElement('x', 16));
    close.onclick = () => this.hide();
    return close;
  }
}

const sheets = new Map<Blockly.WorkspaceSvg, Sheet>();

/** Puts a new sheet beside the canvas of `workspace`. */
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

/** The sheet that this block lies in. */
export function sheetOf(block: Blockly.Block | null | undefined): Sheet | null {
  return block && sheets.get(block.workspace as Blockly.WorkspaceSvg) || null;
}

/** Enter on a block in a sheet takes it. */
const basePerformAction = Blockly.BlockSvg.prototype.performAction;
Blockly.BlockSvg.prototype.performAction = function (this: Blockly.BlockSvg, event?: KeyboardEvent) {
  const sheet = sheetOf(this);
  if (sheet) sheet.pick(this.getRootBlock());
  else basePerformAction.call(this, event);
};

/** So does a click: whether this block was one in a sheet. */
export function activateClicked(block: Blockly.BlockSvg | null): boolean {
  const sheet = sheetOf(block);
  if (sheet && block) sheet.pick(block.getRootBlock());
  return sheet !== null;
}

/** A click on a field there takes the stack as well: what waits is not edited. */
const baseIsClickableInFlyout = Blockly.Field.prototype.isClickableInFlyout;
Blockly.Field.prototype.isClickableInFlyout = function (this: Blockly.Field, closes: boolean) {
  return !sheetOf(this.getSourceBlock()) && baseIsClickableInFlyout.call(this, closes);
};
