// Culling: scripts far outside the view aren't rendered. With a thousand blocks they were most of the cost of a
// drop, a scroll or a highlighted block. The blocks stay in the workspace; only their SVG is left out.
import * as Blockly from 'blockly/core';

const SVG_NS = 'http://www.w3.org/2000/svg';
const CULLED_CLASS = 'nepFar';
/** Distance from the view within which scripts are rendered, in pixels: more than one step of the mouse wheel. */
const MARGIN = 240;

export class Culling {
  /** Wrapper of each hidden script: an <svg>, because browsers compute the layout of a <g> even when not displayed. */
  private readonly hidden = new Map<Blockly.BlockSvg, Element>();
  private waiting = 0;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    const translate = workspace.translate;
    workspace.translate = (x, y) => {
      translate.call(workspace, x, y);
      this.scheduleUpdate();
    };
    workspace.addChangeListener((event) => {
      if (!event.isUiEvent || event.type === Blockly.Events.SELECTED) this.scheduleUpdate();
    });
  }

  /** Schedules an update for the next frame. */
  scheduleUpdate(): void {
    this.waiting ||= window.requestAnimationFrame(() => this.update());
  }

  /** Hides blocks until the next `update()`, such as blocks being loaded, whose position isn't known yet. */
  hide(blocks: Iterable<Blockly.BlockSvg>): void {
    for (const block of blocks) this.setDrawn(block, false);
  }

  update(): void {
    window.cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    const view = this.workspace.getMetricsManager().getViewMetrics(true);
    const margin = MARGIN / this.workspace.scale;
    const renderRect = new Blockly.utils.Rect(view.top - margin, view.top + view.height + margin,
      view.left - margin, view.left + view.width + margin);
    const focused = document.activeElement;
    const tops = new Set(this.workspace.getTopBlocks(false));
    for (const [block, wrapping] of this.hidden) if (!tops.has(block)) this.unwrap(block, wrapping);
    for (const block of tops) {
      // Always render a dragged script, one with the focus (which it would lose), and one with icons, because
      // notes are positioned relative to them.
      this.setDrawn(block, renderRect.intersects(block.getBoundingRectangle()) || block.isDragging() ||
        block.getSvgRoot().contains(focused) || block.getDescendants(false).some((descendant) => descendant.getIcons().length));
    }
  }

  private setDrawn(block: Blockly.BlockSvg, isDrawn: boolean): void {
    const root = block.getSvgRoot();
    const wrapping = this.hidden.get(block);
    const isHidden = wrapping !== undefined && root.parentNode === wrapping;
    if (isHidden !== isDrawn) return;
    if (wrapping) this.unwrap(block, wrapping);
    if (isDrawn) return;
    const wrapper = document.createElementNS(SVG_NS, 'svg');
    wrapper.setAttribute('class', CULLED_CLASS);
    root.replaceWith(wrapper);
    wrapper.append(root);
    this.hidden.set(block, wrapper);
  }

  /** Puts the script back in place of its wrapper to keep the z-order; Blockly may have moved it already. */
  private unwrap(block: Blockly.BlockSvg, wrapping: Element): void {
    wrapping.replaceWith(...wrapping.childNodes);
    this.hidden.delete(block);
  }
}

/** Renders the script that contains this element immediately. */
export function ensureDrawn(element: Element | null | undefined): void {
  const wrapping = element?.closest(`.${CULLED_CLASS}`);
  wrapping?.replaceWith(...wrapping.childNodes);
}
