// Notes: sheets of text beside a block, or anywhere on the canvas. They are Blockly's comments and are saved as such;
// here they get our look, take the keys when they are made, and keep what is typed.
import * as Blockly from 'blockly/core';
import {visibleBlockOf} from './folding';
import {findFreePosition, visibleArea, obstacles} from './free_place';
import {drawIcon} from './icons';
import {t} from './words';

const {Coordinate, Rect, Size} = Blockly.utils;
const SVG_NS = 'http://www.w3.org/2000/svg';
const ICON_SIZE = 20;
const HEADER_HEIGHT = 26;
const BORDER_WIDTH = 6;
const BLOCK_DISTANCE = 26;
const GAP = 12;
/** From a new note to the edge of what can be seen, beside a scrollbar. */
const VIEW_MARGIN = 24;
const DEFAULT_SIZE = [230, 128] as const;
const TYPING_DEBOUNCE_MS = 200;
const FONT_SIZE = 14;
/** On the screen no letter is smaller, however far away the canvas is; up to a size that still fits into a sheet. */
const MIN_FONT_SIZE = 12;
const MAX_FONT_SIZE = 30;

// ---- what is typed

/** Where something was typed that Blockly does not know yet: it asks only when the field is left. */
const dirtyTextAreas = new Set<HTMLTextAreaElement>();
let flushTimer = 0;

/** Tells Blockly what was typed so far; before anything is saved, and when the person rests. */
export function flushTypedText(): void {
  window.clearTimeout(flushTimer);
  for (const area of [...dirtyTextAreas]) {
    dirtyTextAreas.delete(area);
    area.dispatchEvent(new Event('change'));
  }
}

document.addEventListener('input', (event) => {
  const area = event.target;
  if (!(area instanceof HTMLTextAreaElement) || !area.classList.contains('blocklyCommentText')) return;
  dirtyTextAreas.add(area);
  window.clearTimeout(flushTimer);
  flushTimer = window.setTimeout(flushTypedText, TYPING_DEBOUNCE_MS);
}, true);

/** Esc leaves the words of a note on the canvas for the note. Blockly forgets to make it ready for the keys. */
document.addEventListener('keydown', (event) => {
  const note = event.key === 'Escape' && event.target instanceof HTMLTextAreaElement ?
    event.target.closest<SVGElement>('.blocklyComment') : null;
  const workspace = Blockly.common.getMainWorkspace();
  const comment = note && workspace.getCommentById(note.dataset['id'] ?? '');
  if (!(comment instanceof Blockly.comments.RenderedWorkspaceComment)) return;
  event.stopPropagation();
  flushTypedText();
  Blockly.getFocusManager().focusNode(comment);
}, true);

// ---- the sheet of a block

class NoteBubble extends Blockly.bubbles.TextInputBubble {
  private buttons: SVGGElement[] | undefined;
  /** Before the person took it into the hand. */
  private before: Shape | null = null;

  /** A head to take it by, with its buttons; made before the first size is set, which the parent does. */
  addHeader(buttons: [icon: string, words: string, run: () => void][]): void {
    this.svgRoot.classList.add('nepNote');
    this.buttons = buttons.map(([icon, words, run]) => {
      const button = createSvgElement('g', 'nepNoteButton');
      button.setAttribute('role', 'button');
      button.setAttribute('aria-label', words);
      const title = createSvgElement('title', '');
      title.textContent = words;
      const ground = createSvgElement('rect', '');
      for (const [name, value] of [['width', 22], ['height', 22], ['rx', 5]] as const) ground.setAttribute(name, `${value}`);
      const picture = createSvgElement('g', '');
      picture.setAttribute('transform', 'translate(4, 4)');
      drawIcon(picture, icon, 14);
      button.append(title, ground, picture);
      button.addEventListener('pointerdown', (event) => event.stopPropagation());
      button.addEventListener('click', run);
      this.svgRoot.append(button);
      return button as SVGGElement;
    });
    this.setSize(this.getSize());
  }

  set isSeen(visible: boolean) {
    this.svgRoot.style.display = visible ? '' : 'none';
  }

  private get sign(): NoteIcon {
    return this.getOwner() as NoteIcon;
  }

  override startDrag(): Blockly.IBubble {
    this.before = this.sign.shape;
    return super.startDrag();
  }

  override endDrag(): void {
    super.endDrag();
    this.fireChange();
  }

  /** The corner is in the hand until the button is let go, wherever that is. */
  listenForResize(): void {
    this.svgRoot.querySelector('.blocklyResizeHandle')?.addEventListener('pointerdown', () => {
      this.before = this.sign.shape;
      const end = new AbortController();
      for (const name of ['pointerup', 'pointercancel']) {
        window.addEventListener(name, () => {
          end.abort();
          this.fireChange();
        }, {signal: end.signal});
      }
    });
  }

  private fireChange(): void {
    if (this.before && !this.disposed) this.sign.fireNoteChange(this.before);
    this.before = null;
  }

  protected override onKeyDown(event: KeyboardEvent): void {
    const before = this.sign.shape;
    super.onKeyDown(event);
    this.sign.fireNoteChange(before);
  }

  override setSize(size: Blockly.utils.Size, relayout = false): void {
    super.setSize(size, relayout);
    const {width, height} = this.getSize();
    const text = this.getEditor().getDom();
    text.setAttribute('y', `${HEADER_HEIGHT}`);
    text.setAttribute('height', `${Math.max(10, height - HEADER_HEIGHT - BORDER_WIDTH)}`);
    this.buttons?.forEach((button, index) =>
      button.setAttribute('transform', `translate(${width - 26 - 24 * index}, 3)`));
  }
}

/** Where a sheet is, beside the corner of its block, how large, and whether it shows. */
interface Shape {
  open: boolean;
  width: number;
  height: number;
  at: {x: number; y: number} | null;
}

/** A sheet was moved, resized, opened or closed by a person: one step of undo. Blockly itself tells nobody. */
class NoteChange extends Blockly.Events.BlockBase {
  override type = 'nep_note';

  constructor(private readonly block: Blockly.Block, private readonly from: Shape, private readonly to: Shape) {
    super(block);
    this.recordUndo = Blockly.Events.getRecordUndo();
  }

  override isNull(): boolean {
    return JSON.stringify(this.from) === JSON.stringify(this.to);
  }

  override run(forward: boolean): void {
    const block = this.getEventWorkspace_().getBlockById(this.blockId ?? '') ?? this.block;
    const sign = block.getIcon(Blockly.icons.IconType.COMMENT);
    if (!(sign instanceof NoteIcon)) return;
    // A sign that was made just now takes its sheet along when it comes to its place.
    Blockly.renderManagement.triggerQueuedRenders(block.workspace as Blockly.WorkspaceSvg);
    const before = sign.shape;
    sign.shape = forward ? this.to : this.from;
    sign.fireNoteChange(before);  // undo itself is told to nobody, what it does is
  }
}

/** Blockly's own names of where the sheet is, and of what draws from it to the block. */
interface BubbleInternals {
  tail: SVGPathElement;
  renderTail(): void;
}

/** A thin line between block and sheet, in the place of a wedge over the block's words. */
(NoteBubble.prototype as unknown as BubbleInternals).renderTail = function (this: BubbleInternals) {
  const sheet = this as unknown as NoteBubble;
  const block = (sheet.getOwner() as NoteIcon | undefined)?.getSourceBlock();
  if (!(block instanceof Blockly.BlockSvg)) return;
  this.tail.dataset['of'] = block.id;
  const position = sheet.getRelativeToSurfaceXY();
  const {left, right, top} = block.getBoundingRectangleWithoutChildren();
  const middle = top + HEADER_HEIGHT / 2 - position.y;
  const {width} = sheet.getSize();
  const isRight = position.x >= right;
  const from = isRight ? right - position.x : position.x + width <= left ? left - position.x : (left + right) / 2 - position.x;
  const to = isRight ? 0 : position.x + width <= left ? width : width / 2;
  this.tail.setAttribute('d', `M${from},${middle}L${to},${HEADER_HEIGHT / 2}`);
};

/** The id of the block whose note this sheet is. */
export function blockIdOf(sheet: Element): string {
  return sheet.querySelector<SVGElement>('[data-of]')?.dataset['of'] ?? '';
}

function createSvgElement(name: string, kind: string): SVGElement {
  const node = document.createElementNS(SVG_NS, name);
  if (kind) node.setAttribute('class', kind);
  return node;
}

/** The sign on a block that has a note: shows and hides it. */
class NoteIcon extends Blockly.icons.CommentIcon {
  private wasHidden = false;

  constructor(block: Blockly.Block) {
    super(block);
    this.setBubbleSize(new Size(...DEFAULT_SIZE));
  }

  override initView(pressed: (event: PointerEvent) => void): void {
    if (this.svgRoot) return;
    super.initView(pressed);
    const ground = createSvgElement('rect', '');
    for (const [name, value] of [['width', ICON_SIZE], ['height', ICON_SIZE], ['rx', 5]] as const) ground.setAttribute(name, `${value}`);
    const picture = createSvgElement('g', '');
    picture.setAttribute('transform', 'translate(3, 3)');
    drawIcon(picture, 'sticky-note', ICON_SIZE - 6);
    this.svgRoot!.replaceChildren(ground, picture);
    this.svgRoot!.classList.add('nepNoteSign');
  }

  override getSize(): Blockly.utils.Size {
    return new Size(ICON_SIZE, ICON_SIZE);
  }

  /** A folded block still has its own note. */
  override isShownWhenCollapsed(): boolean {
    return true;
  }

  override updateCollapsed(): void {}

  /** Its sheet is seen, or not, as its block is. */
  set isSeen(visible: boolean) {
    const sheet = this.getBubble();
    if (sheet instanceof NoteBubble) sheet.isSeen = visible;
  }

  override async setBubbleVisible(visible: boolean): Promise<void> {
    flushTypedText();
    // A block that is folded up closes all sheets inside it: they are only not seen until it is unfolded.
    if (!visible && this.getBubble() && this.isHidden()) return;
    await super.setBubbleVisible(visible);
  }

  private isHidden(): boolean {
    const block = this.sourceBlock;
    return block instanceof Blockly.BlockSvg && !block.isDeadOrDying() && visibleBlockOf(block) !== block;
  }

  /** What is folded up has no place of its own: the sheet stays where it was until its block has one again. */
  override onLocationChange(corner: Blockly.utils.Coordinate): void {
    const previousLocation = this.getBubbleLocation();
    const unfolded = this.wasHidden && !this.isHidden();
    this.wasHidden = this.isHidden();
    super.onLocationChange(corner);
    if (unfolded && previousLocation) this.setBubbleLocation(previousLocation);
  }

  override onClick(): void {
    const before = this.shape;
    super.onClick();
    this.fireNoteChange(before);
  }

  get shape(): Shape {
    const {width, height} = this.getBubbleSize();
    const location = this.getBubbleLocation();
    const corner = (this.sourceBlock as Blockly.BlockSvg).getRelativeToSurfaceXY();
    return {open: this.bubbleIsVisible(), width, height, at: location ? {x: location.x - corner.x, y: location.y - corner.y} : null};
  }

  set shape({open, width, height, at}: Shape) {
    const corner = (this.sourceBlock as Blockly.BlockSvg).getRelativeToSurfaceXY();
    this.setBubbleSize(new Size(width, height));
    if (at) this.setBubbleLocation(new Coordinate(corner.x + at.x, corner.y + at.y));
    void this.setBubbleVisible(open);
  }

  /** The file is another one now, and undo brings back how the sheet was. */
  fireNoteChange(before: Shape, now = this.shape): void {
    // A sheet that was never open has found its place: that alone is nothing to undo.
    Blockly.Events.fire(new NoteChange(this.sourceBlock, before.at ? before : {...before, at: now.at}, now));
  }

  protected override createBubble(): void {
    const block = this.sourceBlock as Blockly.BlockSvg;
    const anchor = Coordinate.sum(this.workspaceLocation, new Coordinate(ICON_SIZE / 2, ICON_SIZE / 2));
    const sheet = new NoteBubble(block.workspace, anchor, block.getBoundingRectangleWithoutChildren(), this);
    (this as unknown as {textInputBubble: NoteBubble}).textInputBubble = sheet;
    sheet.getEditor().setParent(block);
    sheet.setText(this.getText());
    sheet.setSize(this.getBubbleSize(), true);
    sheet.addHeader([
      ['x', t('Hide the note'), () => this.onClick()],
      ['trash-2', t('Remove the note'), () => removeNote(block)],
    ]);
    sheet.moveDuringDrag(this.getBubbleLocation() ?? getInitialLocation(sheet, block));
    this.setBubbleLocation(sheet.getRelativeToSurfaceXY());
    // The first two listeners of Blockly's own kind are added by the parent.
    sheet.addLocationChangeListener(() => this.onBubbleLocationChange());
    sheet.setAriaLabelProvider(() => t('Note: {text}', {text: this.getText()}));
    this.addKeyListeners(sheet, block);
    sheet.listenForResize();
    sheet.isSeen = visibleBlockOf(block) === block;
  }

  private addKeyListeners(sheet: NoteBubble, block: Blockly.BlockSvg): void {
    const text = sheet.getEditor().getDom();
    text.addEventListener('keydown', (event) => {
      if (event.key !== 'Escape') return;
      event.stopPropagation();
      flushTypedText();
      Blockly.getFocusManager().focusNode(block);
    }, true);
    // A note in which nothing was written would not be saved: it goes when it is left.
    text.addEventListener('focusout', () => window.setTimeout(() => {
      flushTypedText();
      if (!text.contains(document.activeElement) && !block.isDeadOrDying() && this.getText() === '') removeNote(block);
    }));
  }
}

/** Beside the block: on no other block of its stack, on no other stack, in sight. */
function getInitialLocation(sheet: NoteBubble, block: Blockly.BlockSvg): Blockly.utils.Coordinate {
  const {workspace} = block;
  const root = block.getRootBlock();
  const rows = root.getDescendants(false).filter((descendant) => !descendant.outputConnection)
    .map((descendant) => descendant.getBoundingRectangleWithoutChildren());
  const {right, top} = block.getBoundingRectangle();
  const requested = new Coordinate(right + BLOCK_DISTANCE, top);
  const {width, height} = sheet.getSize();
  return findFreePosition(requested, {width, height}, [...obstacles(workspace, new Set([root])), ...rows], visibleArea(workspace), GAP);
}

Blockly.icons.registry.unregister(Blockly.icons.IconType.COMMENT.toString());
Blockly.icons.registry.register(Blockly.icons.IconType.COMMENT, NoteIcon);

function withEventGroup(change: () => void): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  change();
  Blockly.Events.setGroup(group);
}

export function hasNote(block: Blockly.BlockSvg): boolean {
  return block.hasIcon(Blockly.icons.IconType.COMMENT);
}

export function removeNote(block: Blockly.BlockSvg): void {
  const sign = block.getIcon(Blockly.icons.IconType.COMMENT);
  if (!(sign instanceof NoteIcon)) return;
  withEventGroup(() => {
    sign.fireNoteChange(sign.shape, {...sign.shape, open: false});  // undo brings it back as it was
    block.setCommentText(null);
  });
}

/** The words of its note; '' when it has none. */
export function getNoteText(block: Blockly.BlockSvg): string {
  return block.getIcon(Blockly.icons.IconType.COMMENT)?.getText() ?? '';
}

/** The sheet of a note goes and comes with the block that it is beside. */
export function setNoteVisible(block: Blockly.BlockSvg, visible: boolean): void {
  const sign = block.getIcon(Blockly.icons.IconType.COMMENT);
  if (sign instanceof NoteIcon) sign.isSeen = visible;
}

/** An open note that has the keys. */
export async function addNote(block: Blockly.BlockSvg): Promise<void> {
  withEventGroup(() => block.setCommentText(''));
  const sign = block.getIcon(Blockly.icons.IconType.COMMENT);
  if (!(sign instanceof NoteIcon)) return;
  await sign.setBubbleVisible(true);
  const sheet = sign.getBubble();
  if (!(sheet instanceof NoteBubble)) return;
  Blockly.getFocusManager().focusNode(sheet.getEditor());
  const {x, y} = sheet.getRelativeToSurfaceXY();
  const {width, height} = sheet.getSize();
  block.workspace.scrollBoundsIntoView(new Rect(y, y + height, x, x + width), VIEW_MARGIN);  // where all is full it is far off
}

/** A note on the canvas itself, at a place of the page. */
export function addCanvasNote(workspace: Blockly.WorkspaceSvg, screenPosition: {x: number; y: number}): void {
  const wsPosition = Blockly.utils.svgMath.screenToWsCoordinates(workspace, new Coordinate(screenPosition.x, screenPosition.y));
  withEventGroup(() => {
    const note = new Blockly.comments.RenderedWorkspaceComment(workspace);
    note.setSize(new Size(...DEFAULT_SIZE));
    note.moveTo(wsPosition);
    Blockly.getFocusManager().focusNode(note.view.getEditorFocusableNode());
  });
}

/** Lets the words of notes be readable however far away the canvas is. */
export function keepNotesReadable(workspace: Blockly.WorkspaceSvg): void {
  let scale = 0;
  const adapt = () => {
    if (workspace.scale === scale) return;
    ({scale} = workspace);
    const size = Math.min(MAX_FONT_SIZE, Math.max(FONT_SIZE, MIN_FONT_SIZE / scale));
    workspace.getInjectionDiv().style.setProperty('--nep-noteFont', `${size}px`);
  };
  adapt();
  workspace.addChangeListener((event) => event.type === Blockly.Events.VIEWPORT_CHANGE && adapt());
}
