// Scripts far outside the view are not drawn: with a thousand blocks that was most of what a drop, a step of a
// scroll or a running block cost. They stay what they are; only their picture is left out until the view comes near.
import * as Blockly from 'blockly/core';

const SVG = 'http://www.w3.org/2000/svg';
const FAR = 'nepFar';
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
      this.lookSoon();
    };
    workspace.addChangeListener((event) => {
      if (!event.isUiEvent || event.type === Blockly.Events.SELECTED) this.lookSoon();
    });
  }

  /** Looks again before the next picture. */
  lookSoon(): void {
    this.waiting ||= window.requestAnimationFrame(() => this.look());
  }

  /** Leaves these out until `look`: what is being loaded is drawn once its place is known. */
  hide(blocks: Iterable<Blockly.BlockSvg>): void {
    for (const block of blocks) this.show(block, false);
  }

  look(): void {
    window.cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    const view = this.workspace.getMetricsManager().getViewMetrics(true);
    const margin = MARGIN / this.workspace.scale;
    const near = new Blockly.utils.Rect(view.top - margin, view.top + view.height + margin,
      view.left - margin, view.left + view.width + margin);
    const focused = document.activeElement;
    const tops = new Set(this.workspace.getTopBlocks(false));
    for (const [block, wrapping] of this.hidden) if (!tops.has(block)) this.unwrap(block, wrapping);
    for (const block of tops) {
      // A script in the hand goes where it likes, one that loses its picture would lose the keys, a note is put
      // beside the picture of its block.
      this.show(block, near.intersects(block.getBoundingRectangle()) || block.isDragging() ||
        block.getSvgRoot().contains(focused) || block.getDescendants(false).some((each) => each.getIcons().length));
    }
  }

  private show(block: Blockly.BlockSvg, shown: boolean): void {
    const root = block.getSvgRoot();
    const wrapping = this.hidden.get(block);
    const hidden = wrapping !== undefined && root.parentNode === wrapping;
    if (hidden !== shown) return;
    if (wrapping) this.unwrap(block, wrapping);
    if (shown) return;
    const made = document.createElementNS(SVG, 'svg');
    made.setAttribute('class', FAR);
    root.replaceWith(made);
    made.append(root);
    this.hidden.set(block, made);
  }

  /** In the place of the wrapping, so that what lies over what stays; Blockly may have taken the script out of it. */
  private unwrap(block: Blockly.BlockSvg, wrapping: Element): void {
    wrapping.replaceWith(...wrapping.childNodes);
    this.hidden.delete(block);
  }
}

/** Draws the script that holds this element, at once. */
export function drawNow(element: Element | null | undefined): void {
  const wrapping = element?.closest(`.${FAR}`);
  wrapping?.replaceWith(...wrapping.childNodes);
}
