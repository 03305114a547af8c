// Notes beside a block or anywhere on the canvas. They are saved as Blockly's comments; this module adds our
// design, focuses new notes and saves text while it is being typed.
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
/** Margin between a new note and the edge of the view, where the scrollbar is. */
const VIEW_MARGIN = 24;
const DEFAULT_SIZE = [230, 128] as const;
const TYPING_DEBOUNCE_MS = 200;
const FONT_SIZE = 14;
/** Smallest font size on the screen at any zoom, and largest font size that still fits into a note. */
const MIN_FONT_SIZE = 12;
const MAX_FONT_SIZE = 30;

// ---- typed text

/** Text areas with changes that Blockly hasn't read yet: it reads them only when they lose the focus. */
const dirtyTextAreas = new Set<HTMLTextAreaElement>();
let flushTimer = 0;

/** Passes typed text to Blockly; called before saving and after a pause in typing. */
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

/** Focuses the note itself on Escape; Blockly doesn't make it focusable in this case. */
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

// ---- note bubble of a block

class NoteBubble extends Blockly.bubbles.TextInputBubble {
  private buttons: SVGGElement[] | undefined;
  /** Geometry before the user's drag or resize. */
  private before: Shape | null = null;

  /** Adds a header with buttons, by which the note can be dragged; called after the first size was set. */
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

  /** Records a resize by the corner handle until the pointer is released, wherever that happens. */
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

/** State of a note bubble: visibility, size, and position relative to the corner of its block. */
interface Shape {
  open: boolean;
  width: number;
  height: number;
  at: {x: number; y: number} | null;
}

/** Undoable move, resize, opening or closing of a note by the user; Blockly itself fires no event for these. */
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
    // A new icon moves its bubble along when it is positioned, so render first.
    Blockly.renderManagement.triggerQueuedRenders(block.workspace as Blockly.WorkspaceSvg);
    const before = sign.shape;
    sign.shape = forward ? this.to : this.from;
    sign.fireNoteChange(before);  // undo alone notifies no listeners
  }
}

/** Blockly's internal names for the tail of a bubble. */
interface BubbleInternals {
  tail: SVGPathElement;
  renderTail(): void;
}

/** Draws a thin line from the block to the note instead of a wedge, which would cover the block's text. */
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

/** Returns the id of the block that a note bubble belongs to. */
export function blockIdOf(sheet: Element): string {
  return sheet.querySelector<SVGElement>('[data-of]')?.dataset['of'] ?? '';
}

function createSvgElement(name: string, kind: string): SVGElement {
  const node = document.createElementNS(SVG_NS, name);
  if (kind) node.setAttribute('class', kind);
  return node;
}

/** Icon on a block with a note; a click shows or hides the note. */
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

  /** Keeps the icon of a collapsed block's own note visible. */
  override isShownWhenCollapsed(): boolean {
    return true;
  }

  override updateCollapsed(): void {}

  /** Shows or hides the bubble together with its block. */
  set isSeen(visible: boolean) {
    const sheet = this.getBubble();
    if (sheet instanceof NoteBubble) sheet.isSeen = visible;
  }

  override async setBubbleVisible(visible: boolean): Promise<void> {
    flushTypedText();
    // Blockly closes all notes inside a collapsed block; ours stay open but hidden until it is expanded.
    if (!visible && this.getBubble() && this.isHidden()) return;
    await super.setBubbleVisible(visible);
  }

  private isHidden(): boolean {
    const block = this.sourceBlock;
    return block instanceof Blockly.BlockSvg && !block.isDeadOrDying() && visibleBlockOf(block) !== block;
  }

  /** Keeps the bubble in place while its block is hidden in a collapsed block and therefore has no position. */
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

  /** Fires a change event, which makes the change undoable and marks the document as modified. */
  fireNoteChange(before: Shape, now = this.shape): void {
    // The initial placement of a bubble alone is not an undoable change.
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
    // `showEditableBubble()` adds the text and size listeners.
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
    // Remove an empty note when it loses the focus, because it wouldn't be saved.
    text.addEventListener('focusout', () => window.setTimeout(() => {
      flushTypedText();
      if (!text.contains(document.activeElement) && !block.isDeadOrDying() && this.getText() === '') removeNote(block);
    }));
  }
}

/** Returns a free visible position beside the block that covers no block of its stack and no other stack. */
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
    sign.fireNoteChange(sign.shape, {...sign.shape, open: false});  // so that undo restores its state
    block.setCommentText(null);
  });
}

/** Returns the text of the block's note, or "" if it has none. */
export function getNoteText(block: Blockly.BlockSvg): string {
  return block.getIcon(Blockly.icons.IconType.COMMENT)?.getText() ?? '';
}

/** Shows or hides the bubble of a block's note together with the block. */
export function setNoteVisible(block: Blockly.BlockSvg, visible: boolean): void {
  const sign = block.getIcon(Blockly.icons.IconType.COMMENT);
  if (sign instanceof NoteIcon) sign.isSeen = visible;
}

/** Adds an open note to the block and focuses it. */
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
  block.workspace.scrollBoundsIntoView(new Rect(y, y + height, x, x + width), VIEW_MARGIN);  // the only free position may be out of view
}

/** Adds a note to the canvas at a position on the page. */
export function addCanvasNote(workspace: Blockly.WorkspaceSvg, screenPosition: {x: number; y: number}): void {
  const wsPosition = Blockly.utils.svgMath.screenToWsCoordinates(workspace, new Coordinate(screenPosition.x, screenPosition.y));
  withEventGroup(() => {
    const note = new Blockly.comments.RenderedWorkspaceComment(workspace);
    note.setSize(new Size(...DEFAULT_SIZE));
    note.moveTo(wsPosition);
    Blockly.getFocusManager().focusNode(note.view.getEditorFocusableNode());
  });
}

/** Keeps the text of notes readable at any zoom. */
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
