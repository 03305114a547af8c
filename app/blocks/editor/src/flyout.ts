// The blocks of the open category: always as large, as wide as they need, and open as long as the person wants.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {t} from './words';

/** The zoom of a canvas when it is new, and of the flyout at any time. */
export const DEFAULT_SCALE = 0.8;

const MIN_WIDTH = 312;
/** Most categories fit into it: while it stays open, the canvas beside keeps its place from one to the next. */
const PINNED_WIDTH = 400;
/** As much of the page it has from the start while it stays open. */
const PINNED_SHARE = 1 / 3;
/** What is wider, as a list with its items, widens it for its own category only. */
const MAX_STICKY_WIDTH = 500;
/** As much of the page it takes at most; what is wider is scrolled to. */
const MAX_WIDTH_SHARE = 0.45;
const HEADER_HEIGHT = 40;
const SCROLLBAR_MARGIN = 2.5;

export class Flyout extends Blockly.VerticalFlyout {
  override readonly CORNER_RADIUS: number = 0;
  /** Calls when a person wants it to stay open, or not. */
  onPin: (keeps: boolean) => void = () => undefined;
  protected readonly header = document.createElement('div');
  private readonly title = document.createElement('span');
  private readonly button = this.createHeaderButton();
  /** So much below it is left free. */
  protected readonly footerHeight: number = 0;
  /** A class for the style sheet. */
  protected readonly name: string = 'nepCategory';
  private horizontalScrollbar: Blockly.Scrollbar | null = null;
  /** While it stays open, the width that its widest usual category wanted: a narrow one would pull the canvas along. */
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

  /** What it takes of the canvas. */
  override getWidth(): number {
    return this.isVisible() ? super.getWidth() : 0;
  }

  /** Whether it stays open: then the canvas is what lies beside it. */
  get isPinned(): boolean {
    return !this.autoClose;
  }

  setPinned(keeps: boolean): void {
    this.button.setAttribute('aria-pressed', String(keeps));
    if (keeps !== this.isPinned) {
      this.stickyWidth = 0;
      this.setAutoClose(!keeps);
    }
    this.updateOverlayOffset();
  }

  /** Says above the blocks what they are. */
  setTitle(text: string): void {
    this.title.textContent = text;
  }

  /** Whether the keys are on one of its own buttons. */
  get hasFocus(): boolean {
    return this.header.contains(document.activeElement);
  }

  override setVisible(visible: boolean): void {
    super.setVisible(visible);
    this.header.hidden = !visible;
    this.horizontalScrollbar?.setContainerVisible(visible);
    this.updateOverlayOffset();
  }

  /** What floats over the canvas keeps beside it while it stays open. */
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
    // The keys stay where they are: a flyout that loses them closes.
    this.header.onpointerdown = (event) => event.preventDefault();
    this.header.append(this.title, this.button);
    this.header.style.height = `${HEADER_HEIGHT}px`;
    container.append(this.header);
  }

  /** The one in its head. */
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

// Its buttons ("New variable") are as high as the others of Studio, in pixels at its scale.
Blockly.FlyoutButton.TEXT_MARGIN_X = 16;
Blockly.FlyoutButton.TEXT_MARGIN_Y = 11;
Blockly.FlyoutButton.BORDER_RADIUS = 8;

/** A click on a field in the flyout opens it: the chosen value is what is dragged out next. */
Blockly.Field.prototype.isClickableInFlyout = () => true;
