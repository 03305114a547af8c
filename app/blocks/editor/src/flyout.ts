// The blocks of the open category: always as large, as wide as they need, and open as long as the person wants.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {t} from './words';

/** The zoom of a canvas when it is new, and of the flyout at any time. */
export const SCALE = 0.8;

const LEAST_WIDTH = 312;
/** Most categories fit into it: while it stays open, the canvas beside keeps its place from one to the next. */
const PINNED_WIDTH = 400;
/** As much of the page it has from the start while it stays open. */
const PINNED_SHARE = 1 / 3;
/** What is wider, as a list with its items, widens it for its own category only. */
const KEPT_WIDTH = 500;
/** As much of the page it takes at most; what is wider is scrolled to. */
const MOST = 0.45;
const HEAD = 40;
const MARGIN = 2.5;

export class Flyout extends Blockly.VerticalFlyout {
  override readonly CORNER_RADIUS: number = 0;
  /** Calls when a person wants it to stay open, or not. */
  onPin: (keeps: boolean) => void = () => undefined;
  protected readonly head = document.createElement('div');
  private readonly title = document.createElement('span');
  private readonly button = this.makeButton();
  /** So much below it is left free. */
  protected readonly foot: number = 0;
  /** A class for the style sheet. */
  protected readonly name: string = 'nepCategory';
  private across: Blockly.Scrollbar | null = null;
  /** While it stays open, the width that its widest usual category wanted: a narrow one would pull the canvas along. */
  private kept = 0;

  override init(target: Blockly.WorkspaceSvg): void {
    super.init(target);
    this.across = new Blockly.Scrollbar(this.workspace_, true, false, 'blocklyFlyoutScrollbar', MARGIN);
    this.across.setContainerVisible(false);
    this.makeHead(target.getInjectionDiv());
  }

  override dispose(): void {
    this.across?.dispose();
    this.head.remove();
    super.dispose();
  }

  override getFlyoutScale(): number {
    return SCALE;
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
      this.kept = 0;
      this.setAutoClose(!keeps);
    }
    this.leaveRoom();
  }

  /** Says above the blocks what they are. */
  setTitle(words: string): void {
    this.title.textContent = words;
  }

  /** Whether the keys are on one of its own buttons. */
  get hasFocus(): boolean {
    return this.head.contains(document.activeElement);
  }

  override setVisible(visible: boolean): void {
    super.setVisible(visible);
    this.head.hidden = !visible;
    this.across?.setContainerVisible(visible);
    this.leaveRoom();
  }

  /** What floats over the canvas keeps beside it while it stays open. */
  protected leaveRoom(): void {
    if (this.targetWorkspace.getInjectionDiv().closest('[hidden]')) return;
    document.documentElement.style.setProperty('--flyout', `${this.isPinned ? this.getWidth() : 0}px`);
  }

  override position(): void {
    if (this.isVisible()) this.width_ = this.wantedWidth();
    super.position();
    this.head.style.left = `${this.getX()}px`;
    this.head.style.width = `${this.getWidth()}px`;
    this.leaveRoom();
  }

  protected override positionAt_(width: number, height: number, x: number, y: number): void {
    super.positionAt_(width, Math.max(0, height - HEAD - this.foot), x, y + HEAD);
    if (!this.across) return;
    this.across.setOrigin(x, y + HEAD);
    this.across.resize();
    this.across.setPosition(this.across.position.x, this.across.position.y);
  }

  protected override reflowInternal_(): void {
    this.workspace_.scale = this.getFlyoutScale();
    if (this.width_ === this.wantedWidth()) {
      this.across?.resize();
      return;
    }
    this.position();
    this.targetWorkspace.resizeContents();
    this.targetWorkspace.recordDragTargets();
  }

  private wantedWidth(): number {
    const widths = this.getContents().map((item) => item.getElement().getBoundingRectangle().getWidth());
    const widest = Math.max(0, ...widths) + this.MARGIN * 1.5 + this.tabWidth_;
    const wanted = widest * this.getFlyoutScale() + Blockly.Scrollbar.scrollbarThickness;
    const page = this.targetWorkspace.getCachedParentSvgSize().width;
    if (!this.isPinned || !this.isVisible()) return Math.round(Math.max(LEAST_WIDTH, Math.min(wanted, page * MOST)));
    if (wanted <= KEPT_WIDTH) this.kept = Math.max(this.kept, wanted);
    const pinned = Math.max(wanted, this.kept, Math.min(PINNED_WIDTH, page * PINNED_SHARE));
    return Math.round(Math.max(LEAST_WIDTH, Math.min(pinned, page * MOST)));
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
    const across = event.shiftKey ? x || y : x;
    if (across) {
      const view = this.workspace_.getMetricsManager().getViewMetrics();
      this.across?.set(view.left + across);
    }
    if (!event.shiftKey) super.wheel_(event);
    event.preventDefault();
    event.stopPropagation();
  }

  private makeHead(place: Element): void {
    this.head.className = `nepFlyoutHead ${this.name}`;
    this.svgGroup_?.classList.add(this.name);
    this.head.hidden = true;
    // The keys stay where they are: a flyout that loses them closes.
    this.head.onpointerdown = (event) => event.preventDefault();
    this.head.append(this.title, this.button);
    this.head.style.height = `${HEAD}px`;
    place.append(this.head);
  }

  /** The one in its head. */
  protected makeButton(): HTMLButtonElement {
    const pin = document.createElement('button');
    const words = t('Pin the block list');
    pin.type = 'button';
    pin.title = words;
    pin.setAttribute('aria-label', words);
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
