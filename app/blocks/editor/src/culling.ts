// Scripts far outside the view are not drawn: with a thousand blocks that was most of what a drop, a step of a
// scroll or a running block cost. They stay what they are; only their picture is left out until the view comes near.
import * as Blockly from 'blockly/core';

const SVG_NS = 'http://www.w3.org/2000/svg';
const CULLED_CLASS = 'nepFar';
/** How far outside the view scripts are drawn, in pixels: more than one turn of a wheel. */
const MARGIN = 240;

export class Culling {
  /** Each hidden script's wrapping: a <g> that is not displayed is laid out all the same, what is in an <svg> is not. */
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

  /** Looks again before the next picture. */
  scheduleUpdate(): void {
    this.waiting ||= window.requestAnimationFrame(() => this.update());
  }

  /** Leaves these out until `look`: what is being loaded is drawn once its place is known. */
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
      // A script in the hand goes where it likes, one that loses its picture would lose the keys, a note is put
      // beside the picture of its block.
      this.setDrawn(block, renderRect.intersects(block.getBoundingRectangle()) || block.isDragging() ||
        block.getSvgRoot().contains(focused) || block.getDescendants(false).some((descendant) => descendant.getIcons().length));
    }
  }

  private setDrawn(block: Blockly.BlockSvg, drawn: boolean): void {
    const root = block.getSvgRoot();
    const wrapping = this.hidden.get(block);
    const hidden = wrapping !== undefined && root.parentNode === wrapping;
    if (hidden !== drawn) return;
    if (wrapping) this.unwrap(block, wrapping);
    if (drawn) return;
    const wrapper = document.createElementNS(SVG_NS, 'svg');
    wrapper.setAttribute('class', CULLED_CLASS);
    root.replaceWith(wrapper);
    wrapper.append(root);
    this.hidden.set(block, wrapper);
  }

  /** In the place of the wrapping, so that what lies over what stays; Blockly may have taken the script out of it. */
  private unwrap(block: Blockly.BlockSvg, wrapping: Element): void {
    wrapping.replaceWith(...wrapping.childNodes);
    this.hidden.delete(block);
  }
}

/** Draws the script that holds this element, at once. */
export function ensureDrawn(element: Element | null | undefined): void {
  const wrapping = element?.closest(`.${CULLED_CLASS}`);
  wrapping?.replaceWith(...wrapping.childNodes);
}
