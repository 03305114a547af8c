// Hint near a position on the canvas; hides after some seconds, at the next click or when the view moves.
import * as Blockly from 'blockly/core';

const DISPLAY_MS = 6000;
const MARGIN = 12;
const GAP = 26;
const hints = new WeakMap<Blockly.Workspace, Hint>();

export class Hint {
  private readonly box = document.createElement('div');
  private timer = 0;
  private view = '';

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    hints.set(workspace, this);
    this.box.className = 'nepWhy';
    this.box.setAttribute('role', 'status');
    workspace.getInjectionDiv().append(this.box);
    workspace.addChangeListener((event) => {
      // the event of an earlier change, such as the closing flyout, may arrive late
      if (event.type === Blockly.Events.VIEWPORT_CHANGE && this.view !== this.currentView()) this.hide();
    });
    workspace.getInjectionDiv().addEventListener('pointerdown', () => this.hide(), true);
  }

  /** Returns the hint of a workspace. */
  static of(workspace: Blockly.Workspace | null | undefined): Hint | null {
    return (workspace && hints.get(workspace)) ?? null;
  }

  dispose(): void {
    window.clearTimeout(this.timer);
  }

  /** Shows the text below this position on the page, or above it if there is no space. */
  show(text: string, position: Blockly.utils.Coordinate): void {
    window.clearTimeout(this.timer);
    this.view = this.currentView();
    this.box.textContent = text;
    const frame = this.workspace.getInjectionDiv().getBoundingClientRect();
    const {offsetWidth, offsetHeight} = this.box;
    const left = Math.max(MARGIN, Math.min(position.x - frame.left, frame.width - offsetWidth - MARGIN));
    const below = position.y - frame.top + GAP;
    const top = below + offsetHeight + MARGIN < frame.height ? below : position.y - frame.top - offsetHeight - GAP;
    this.box.style.left = `${left}px`;
    this.box.style.top = `${Math.max(MARGIN, top)}px`;
    this.timer = window.setTimeout(() => this.hide(), DISPLAY_MS);
  }

  private currentView(): string {
    const {scrollX, scrollY, scale} = this.workspace;
    return [scrollX, scrollY, scale].join();
  }

  hide(): void {
    if (!this.box.textContent) return;
    window.clearTimeout(this.timer);
    this.box.textContent = '';
  }

  /** Bounds of the hint on the page. */
  get bounds(): DOMRect {
    return this.box.getBoundingClientRect();
  }
}
