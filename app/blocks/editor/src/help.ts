// Help card for a block, with the texts from the window.
import * as Blockly from 'blockly/core';
import {iconElement, iconName} from './icons';
import {isUnknown} from './unknown_blocks';
import {definitionOf} from './definitions';
import {t} from './words';

export interface BlockHelp {
  title: string;
  /** Name of the block in a sentence, such as “walk”; "" if its label has only symbols. */
  name: string;
  does: string;
  more: string;
  gaps: [string, string][];
  example: string;
  /** Search terms: synonyms in the user's language and in English, and the options of the block's fields. */
  words: string;
  english: string;
  choices: string[];
}

let helpByType: Record<string, BlockHelp> = {};

export function setHelp(help: Record<string, BlockHelp>): void {
  helpByType = help;
}

export function helpFor(type: string): BlockHelp | null {
  return Object.hasOwn(helpByType, type) ? helpByType[type] ?? null : null;
}

/** Returns the focused block, on the canvas or in the toolbox; a focused field or slot counts as its block. */
export function focusedBlock(): Blockly.BlockSvg | null {
  const node = Blockly.getFocusManager().getFocusedNode();
  const source = node instanceof Blockly.BlockSvg ? node :
    node instanceof Blockly.Field || node instanceof Blockly.RenderedConnection ? node.getSourceBlock() : null;
  let block = source instanceof Blockly.BlockSvg ? source : null;
  // A shadow block counts as part of its parent.
  while (block?.isShadow() && block.getParent()) block = block.getParent();
  return block;
}

export class HelpCard {
  private card: HTMLElement | null = null;
  private previousFocus: Blockly.IFocusableNode | null = null;

  /** Shows the help of this block; returns false if there is none. */
  show(block: Blockly.BlockSvg | null): boolean {
    const help = block ? isUnknown(block) ? unknownBlockHelp(block) : helpFor(block.type) : null;
    if (!block || !help) return false;
    this.close();
    this.previousFocus = Blockly.getFocusManager().getFocusedNode();
    this.card = this.createCard(help, block);
    document.body.append(this.card);
    this.card.querySelector<HTMLElement>('button')?.focus();
    return true;
  }

  close(): void {
    if (!this.card) return;
    const hadFocus = this.card.contains(document.activeElement);
    this.card.remove();
    this.card = null;
    if (hadFocus && this.previousFocus?.canBeFocused()) Blockly.getFocusManager().focusNode(this.previousFocus);
    this.previousFocus = null;
  }

  private createCard(help: BlockHelp, block: Blockly.BlockSvg): HTMLElement {
    const card = createElement('aside', 'nepHelp');
    card.setAttribute('role', 'dialog');
    card.setAttribute('aria-label', t('Help: {block}', {block: help.title}));
    const header = createElement('header', '');
    const tile = createElement('span', 'nepTile');
    tile.style.background = block.getColour();
    const style = block.getStyleName();
    const first = definitionOf(block.type)?.['args0'] as {icon?: string}[] | undefined;
    tile.append(iconElement(iconName(first?.[0]?.icon ?? '', style), 16));
    const close = document.createElement('button');
    close.type = 'button';
    close.title = t('Close (Esc)');
    close.setAttribute('aria-label', t('Close help'));
    close.append(iconElement('x', 16));
    close.onclick = () => this.close();
    header.append(tile, createElement('h2', '', help.title), close);
    card.append(header, createElement('p', '', help.does));
    if (help.more) card.append(createElement('p', '', help.more));
    if (help.gaps.length) {
      const list = createElement('dl', '');
      for (const [name, words] of help.gaps) list.append(createElement('dt', '', name), createElement('dd', '', words));
      card.append(list);
    }
    card.append(createElement('p', 'nepExample', help.example));
    card.onkeydown = (event) => {
      event.stopPropagation();
      if (event.key === 'Escape') this.close();
    };
    return card;
  }
}

function unknownBlockHelp(block: Blockly.BlockSvg): BlockHelp {
  return {title: t('Unknown block'), name: '', does: String(block.getTooltip()),
    more: t('It may belong to a robot that was never connected here, or to a newer version of Studio. It stays in the file unchanged.'),
    gaps: [], example: t('If the block belongs to a robot, connect that robot.'), words: '', english: '', choices: []};
}

function createElement(tag: string, name: string, text = ''): HTMLElement {
  const node = document.createElement(tag);
  if (name) node.className = name;
  if (text) node.textContent = text;
  return node;
}

/** Registers “Help” in the context menu of blocks that have a help text. */
export function registerHelpMenu(show: (block: Blockly.BlockSvg) => void): void {
  Blockly.ContextMenuRegistry.registry.register({
    id: 'nepHelp',
    weight: 90,
    scopeType: Blockly.ContextMenuRegistry.ScopeType.BLOCK,
    displayText: () => t('Help'),
    preconditionFn: ({block}) => block && (isUnknown(block) || helpFor(block.type)) ? 'enabled' : 'hidden',
    callback: ({block}) => block && show(block),
  });
}
