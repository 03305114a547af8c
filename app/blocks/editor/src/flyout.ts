// Flyout with a constant scale and a width that fits its blocks; it can be pinned open.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {t} from './words';

/** Initial scale of a canvas and constant scale of the flyout. */
export const DEFAULT_SCALE = 0.8;

const MIN_WIDTH = 312;
/** Minimum width while pinned; fits most categories, so that the canvas doesn't move when the category changes. */
const PINNED_WIDTH = 400;
/** Maximum share of the page that `PINNED_WIDTH` may take. */
const PINNED_SHARE = 1 / 3;
/** Width above which contents, such as a list with its items, widen the flyout for their own category only. */
const MAX_STICKY_WIDTH = 500;
/** Maximum share of the page; wider contents can be scrolled. */
const MAX_WIDTH_SHARE = 0.45;
const HEADER_HEIGHT = 40;
const SCROLLBAR_MARGIN = 2.5;

export class Flyout extends Blockly.VerticalFlyout {
  override readonly CORNER_RADIUS: number = 0;
  /** Called when the user pins or unpins the flyout. */
  onPin: (isPinned: boolean) => void = () => undefined;
  protected readonly header = document.createElement('div');
  private readonly title = document.createElement('span');
  private readonly button = this.createHeaderButton();
  /** Height of the free area below the flyout. */
  protected readonly footerHeight: number = 0;
  /** CSS class. */
  protected readonly name: string = 'nepCategory';
  private horizontalScrollbar: Blockly.Scrollbar | null = null;
  /** Widest usual category while pinned; kept for narrower ones so that the canvas doesn't move. */
  private stickyWidth = 0;

  override init(target: Blockly.WorkspaceSvg): void {
    super.init(target);
    this.horizontalScrollbar = new Blockly.Scrollbar(this.workspace_, true, false, 'blocklyFlyoutScrollbar', SCROLLBAR_MARGIN);
    this.horizontalScrollbar.setContainerVisible(false);
    this.createHeader(target.getInjectionDiv());
  }

  override dispose(): void {
    this.horizontalScrollbar?.dispose();
    this.header.remove();
    super.dispose();
  }

  override getFlyoutScale(): number {
    return DEFAULT_SCALE;
  }

  /** Returns the width that the flyout takes from the canvas. */
  override getWidth(): number {
    return this.isVisible() ? super.getWidth() : 0;
  }

  /** True if the flyout stays open, in which case the canvas is beside it. */
  get isPinned(): boolean {
    return !this.autoClose;
  }

  setPinned(isPinned: boolean): void {
    this.button.setAttribute('aria-pressed', String(isPinned));
    if (isPinned !== this.isPinned) {
      this.stickyWidth = 0;
      this.setAutoClose(!isPinned);
    }
    this.updateOverlayOffset();
  }

  /** Sets the title above the blocks. */
  setTitle(text: string): void {
    this.title.textContent = text;
  }

  /** True if the focus is on a button of the header. */
  get hasFocus(): boolean {
    return this.header.contains(document.activeElement);
  }

  override setVisible(visible: boolean): void {
    super.setVisible(visible);
    this.header.hidden = !visible;
    this.horizontalScrollbar?.setContainerVisible(visible);
    this.updateOverlayOffset();
  }

  /** Moves overlays of the canvas beside the pinned flyout. */
  protected updateOverlayOffset(): void {
    if (this.targetWorkspace.getInjectionDiv().closest('[hidden]')) return;
    document.documentElement.style.setProperty('--flyout', `${this.isPinned ? this.getWidth() : 0}px`);
  }

  override position(): void {
    if (this.isVisible()) this.width_ = this.preferredWidth();
    super.position();
    this.header.style.left = `${this.getX()}px`;
    this.header.style.width = `${this.getWidth()}px`;
    this.updateOverlayOffset();
  }

  protected override positionAt_(width: number, height: number, x: number, y: number): void {
    super.positionAt_(width, Math.max(0, height - HEADER_HEIGHT - this.footerHeight), x, y + HEADER_HEIGHT);
    if (!this.horizontalScrollbar) return;
    this.horizontalScrollbar.setOrigin(x, y + HEADER_HEIGHT);
    this.horizontalScrollbar.resize();
    this.horizontalScrollbar.setPosition(this.horizontalScrollbar.position.x, this.horizontalScrollbar.position.y);
  }

  protected override reflowInternal_(): void {
    this.workspace_.scale = this.getFlyoutScale();
    if (this.width_ === this.preferredWidth()) {
      this.horizontalScrollbar?.resize();
      return;
    }
    this.position();
    this.targetWorkspace.resizeContents();
    this.targetWorkspace.recordDragTargets();
  }

  private preferredWidth(): number {
    const widths = this.getContents().map((item) => item.getElement().getBoundingRectangle().getWidth());
    const widest = Math.max(0, ...widths) + this.MARGIN * 1.5 + this.tabWidth_;
    const contentWidth = widest * this.getFlyoutScale() + Blockly.Scrollbar.scrollbarThickness;
    const page = this.targetWorkspace.getCachedParentSvgSize().width;
    if (!this.isPinned || !this.isVisible()) return Math.round(Math.max(MIN_WIDTH, Math.min(contentWidth, page * MAX_WIDTH_SHARE)));
    if (contentWidth <= MAX_STICKY_WIDTH) this.stickyWidth = Math.max(this.stickyWidth, contentWidth);
    const pinned = Math.max(contentWidth, this.stickyWidth, Math.min(PINNED_WIDTH, page * PINNED_SHARE));
    return Math.round(Math.max(MIN_WIDTH, Math.min(pinned, page * MAX_WIDTH_SHARE)));
  }

  protected override setMetrics_(ratio: {x: number; y: number}): void {
    if (this.isVisible() && typeof ratio.x === 'number') {
      const metrics = this.workspace_.getMetricsManager();
      const room = metrics.getScrollMetrics().width - metrics.getViewMetrics().width;
      this.workspace_.scrollX = -Math.max(0, room) * ratio.x;
    }
    super.setMetrics_(ratio);
  }

  protected override wheel_(event: WheelEvent): void {
    const {x, y} = Blockly.browserEvents.getScrollDeltaPixels(event);
    const deltaX = event.shiftKey ? x || y : x;
    if (deltaX) {
      const view = this.workspace_.getMetricsManager().getViewMetrics();
      this.horizontalScrollbar?.set(view.left + deltaX);
    }
    if (!event.shiftKey) super.wheel_(event);
    event.preventDefault();
    event.stopPropagation();
  }

  private createHeader(container: Element): void {
    this.header.className = `nepFlyoutHead ${this.name}`;
    this.svgGroup_?.classList.add(this.name);
    this.header.hidden = true;
    // Keep the focus where it is: a flyout that loses it closes.
    this.header.onpointerdown = (event) => event.preventDefault();
    this.header.append(this.title, this.button);
    this.header.style.height = `${HEADER_HEIGHT}px`;
    container.append(this.header);
  }

  /** Creates the button in the header. */
  protected createHeaderButton(): HTMLButtonElement {
    const pin = document.createElement('button');
    const label = t('Pin the block list');
    pin.type = 'button';
    pin.title = label;
    pin.setAttribute('aria-label', label);
    pin.setAttribute('aria-pressed', 'false');
    pin.append(iconElement('pin', 16));
    pin.onclick = () => this.onPin(!this.isPinned);
    return pin;
  }
}

export const FLYOUT = 'nep';
Blockly.registry.register(Blockly.registry.Type.FLYOUTS_VERTICAL_TOOLBOX, FLYOUT, Flyout);

// Gives flyout buttons ("New variable") the height of Studio's other buttons, in pixels at the flyout's scale.
Blockly.FlyoutButton.TEXT_MARGIN_X = 16;
Blockly.FlyoutButton.TEXT_MARGIN_Y = 11;
Blockly.FlyoutButton.BORDER_RADIUS = 8;

/** Opens fields in the flyout on a click, so that a value can be set before the block is dragged out. */
Blockly.Field.prototype.isClickableInFlyout = () => true;
