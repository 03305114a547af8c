// The page of the block editor: what the window tells it (`nepReceive`) and what it tells the window.
import * as Blockly from 'blockly/core';
import './blockly_patches';
import './fields';
import './focus_after_delete';
import './mutators';
import {giveBlocklyOurWords} from './blockly_words';
import './near';
import './number_field';
import {type Packed, backpackButton, registerBackpack, showContents} from './backpack';
import {Carrying} from './carrying';
import {Clipboard} from './clipboard';
import {type Begin, EmptyCanvas, Pointer, type Wanted} from './guidance';
import {binButton} from './bin';
import {chooseAll, frameButton} from './frame';
import {HelpCard, focusedBlock, registerHelpMenu} from './help';
import {Inbox} from './inbox';
import {iconElement} from './icons';
import {useClipboard, useOwnKeys} from './keys';
import {registerMenu, registerPictureMenu, trimMenu} from './menu';
import {asPng, pictureOf} from './picture';
import {type Wanted as Paper, clearPages, layPages} from './print';
import {FindBar} from './search';
import {followModality, setKeyboardLed} from './modality';
import {type Tab} from './tab';
import {type Definitions, type ShownTab, Tabs} from './tabs';
import {setCssVariables} from './theme';
import {type Tokens, useTokens} from './tokens';
import {type Alarm, showAlarms} from './toolbox';
import {type VariableEdit, askWindow, registerVariableMenu} from './variable_edits';
import type {VariableValue} from './watched_values';
import {TryAnswer, registerTries} from './tries';
import {t, useWords} from './words';

interface Bridge {
  told: {connect(slot: (name: string, payload: string) => void): void};
  beginning(): Promise<string>;
  ready(): void;
  changed(key: string, generation: number, json: string): void;
  history(canUndo: boolean, canRedo: boolean): void;
  selected(id: string): void;
  flushed(token: number, json: string): void;
  pictured(token: number, data: string): void;
  failed(sentence: string): void;
  opened(): void;
  on_block(has: boolean): void;
  offers(sensors: string): void;
  copy(text: string): void;
  copied(): Promise<string>;
  command(name: string): void;
  watches(variables: string): void;
  wants(what: string): void;
  tries(stack: string): void;
  pin(keeps: boolean): void;
  deleted(count: number): void;
  carried(x: number, y: number, out: boolean, home: string): void;
  pictureOfCarried(data: string, ratio: number): void;
  dropped(x: number, y: number): void;
  brought(count: number, how: string, from: string): void;
  backpack(asked: string): void;
}

declare const QWebChannel: new (transport: unknown, done: (channel: {objects: {bridge: Bridge}}) => void) => unknown;
declare const qt: {webChannelTransport: unknown};

class Editor {
  private readonly tabs: Tabs;
  private readonly help = new HelpCard();
  private readonly clipboard: Clipboard;
  private readonly answer = new TryAnswer();
  private readonly carrying: Carrying;
  private offered = '[]';
  private watched = '[]';
  private readonly find = new FindBar(() => this.shown.workspace);
  private readonly pointer = new Pointer(() => this.shown.workspace);
  private readonly empty: EmptyCanvas;

  constructor(private readonly bridge: Bridge, pinned: boolean | null, private theme: {tokens: Tokens; dark: boolean}) {
    this.empty = new EmptyCanvas(() => this.shown.workspace, this.pointer, (what) => bridge.wants(what));
    this.carrying = new Carrying({
      carried: (x, y, out, home) => bridge.carried(x, y, out, home),
      pictured: (data, ratio) => bridge.pictureOfCarried(data, ratio),
      dropped: (x, y) => bridge.dropped(x, y),
      brought: (count, how, from) => bridge.brought(count, how, from),
    }, () => this.shown);
    const ofShown = (tab: Tab, tell: () => void) => {
      if (tab === this.tabs?.shown) tell();
    };
    this.tabs = new Tabs(document.getElementById('workspace')!, {
      changed: (tab, json) => {
        bridge.changed(tab.key, tab.generation, json);
        this.find.again();
      },
      history: (tab, canUndo, canRedo) => ofShown(tab, () => bridge.history(canUndo, canRedo)),
      selected: (tab, id) => ofShown(tab, () => bridge.selected(id)),
      offered: (tab) => ofShown(tab, () => this.tellOffered()),
      watched: (tab) => ofShown(tab, () => this.tellWatched()),
      made: (tab) => this.empty.watch(tab.workspace),
      pinned: (keeps) => {
        bridge.pin(keeps);
        this.tabs.setPinned(keeps);
      },
      deleted: (tab, count) => ofShown(tab, () => bridge.deleted(count)),
      binned: (tab) => ofShown(tab, () => this.dressBin()),
      outside: (mouse, items) => this.carrying.over(mouse, items),
      dragEnded: (placed, copies) => this.carrying.dragEnded(placed, copies),
      letGoOutside: (tab, what, mouse) => this.carrying.letGo(tab, what, mouse),
    });
    this.tabs.setPinned(pinned);
    // On paper the page has another size for a moment.
    new ResizeObserver(() => window.matchMedia('print').matches || this.tabs.resize()).observe(document.body);
    // A hidden page draws no frames, and Blockly tells of edits only after a frame.
    document.addEventListener('visibilitychange', () => document.hidden && this.shown.program.flush());
    this.makeZoomButtons();
    registerTries((what) => bridge.tries(JSON.stringify(what)));
    registerHelpMenu((block) => this.help.show(block));
    this.clipboard = new Clipboard({write: (text) => bridge.copy(text), read: () => bridge.copied()});
    useClipboard(this.clipboard);
    registerMenu(this.clipboard);
    registerBackpack((asked) => bridge.backpack(asked), () => this.shown.backpack);
    registerPictureMenu((command) => bridge.command(command));
    // Keys that come while nothing in the page has them, as after a change of tabs, are the canvas's.
    document.addEventListener('keydown', (event) => {
      if (document.activeElement !== document.body || !(event.ctrlKey || event.metaKey)) return;
      Blockly.ShortcutRegistry.registry.onKeyDown(this.shown.workspace, event);
    });
    askWindow((command) => bridge.command(command));
    registerVariableMenu((id) => this.shown.watched.isWatched(id));
    let told = false;
    const tellBlock = () => queueMicrotask(() => {
      const has = focusedBlock() !== null;
      if (has !== told) bridge.on_block(told = has);
    });
    document.addEventListener('focusin', tellBlock);
    document.addEventListener('focusout', tellBlock);
    document.addEventListener('keydown', (event) => {
      if (event.key.toLowerCase() !== 'f' || event.altKey || !(event.ctrlKey || event.metaKey)) return;
      event.preventDefault();
      if (event.shiftKey) this.shown.search();
      else this.find.open();
    }, true);
  }

  receive(name: string, payload: string): void {
    const command = this.commands[name];
    if (!command) throw new Error(`no command ${name}`);
    command(JSON.parse(payload) as never);
  }

  private get shown(): Tab {
    return this.tabs.shown;
  }

  private readonly commands: Record<string, (payload: never) => void> = {
    theme: (it: {tokens: Tokens; dark: boolean}) => this.setTheme(it.tokens, it.dark),
    motion: (it: {reduced: boolean}) => document.documentElement.classList.toggle('reduced', it.reduced),
    definitions: (it: Definitions) => this.tabs.define(it),
    tab: (it: ShownTab) => this.showTab(it),
    pin: (pinned: boolean | null) => this.tabs.setPinned(pinned),
    close: (key: string) => this.tabs.close(key),
    highlight: (ids: string[]) => this.shown.overlays.highlight(ids),
    stopped: (ids: string[]) => this.shown.overlays.markStopped(ids),
    errors: (errors: Record<string, string>) => this.setErrors(errors),
    value: ([id, words]: [string, string]) => this.sayBeside(id, words, false),
    warnings: (warnings: Record<string, string>) => this.shown.overlays.setWarnings(warnings),
    absent: (ids: string[]) => this.shown.overlays.setAbsent(ids),
    values: (values: Record<string, VariableValue>) => this.shown.watched.show(values),
    variable: (it: VariableEdit) => this.shown.editVariable(it),
    alarms: (alarms: Record<string, Alarm>) => showAlarms(alarms),
    live: (it: {values: Record<string, string>; old: string[]}) => this.shown.overlays.setLive(it.values, it.old),
    flush: (token: number) => this.bridge.flushed(token, this.shown.program.flush()),
    picture: (it: WantedPicture) => void this.takePicture(it),
    pages: (it: Paper & {token: number}) => this.layPages(it),
    printed: () => clearPages(),
    change: (state: Record<string, unknown>) => this.shown.change(state),
    undo: () => this.shown.program.undo(false),
    bring: () => this.carrying.bring(this.shown),
    giveBack: () => this.carrying.giveBack(),
    backpack: (items: Packed[]) => showContents(items),
    undelete: () => this.shown.bin.undoLast() && this.shown.program.undo(false),
    redo: () => this.shown.program.undo(true),
    zoom: (steps: number) => this.shown.workspace.zoomCenter(steps),
    fit: () => this.shown.fit(),
    show: (id: string) => this.shown.reveal(id),
    help: () => this.help.show(focusedBlock()),
    find: () => {
      this.find.open();
      this.bridge.opened();
    },
    keyboard: () => setKeyboardLed(true),
    search: () => {
      this.shown.search();
      this.bridge.opened();
    },
    edit: (what: 'copy' | 'cut' | 'paste' | 'duplicate' | 'selectAll') => {
      // What we are told may be here before the keys are: until they come Blockly knows of no chosen block.
      if (!this.shown.hasFocus || !Blockly.getFocusManager().getFocusedNode()) this.shown.focus();
      if (what === 'selectAll') chooseAll(this.shown.workspace);
      else void this.clipboard[what]();
    },
    begin: (it: Begin | null) => it && this.empty.tell(it),
    point: (it: Wanted | null) => this.pointer.show(it),
  };

  /** A block of the toolbox that was tried says so, too. */
  private setErrors(errors: Record<string, string>): void {
    this.shown.overlays.setErrors(errors);
    for (const [id, sentence] of Object.entries(errors)) {
      if (!this.shown.workspace.getBlockById(id)) this.sayBeside(id, sentence, true);
    }
  }

  private sayBeside(id: string, words: string, isError: boolean): void {
    const {workspace} = this.shown;
    const block = workspace.getBlockById(id) ?? workspace.getFlyout()?.getWorkspace().getBlockById(id);
    if (block instanceof Blockly.BlockSvg) this.answer.say(block, words, isError);
  }

  private showTab(it: ShownTab): void {
    this.help.close();
    this.carrying.turn(() => this.tabs.show(it));
    this.find.again();
    this.empty.lookSoon();
    this.dressBin();
    this.tellOffered();
    this.tellWatched();
  }

  /** The window tells what these variables hold. */
  private tellWatched(): void {
    const watched = JSON.stringify(this.shown.watched.ids);
    if (watched !== this.watched) this.bridge.watches(this.watched = watched);
  }

  /** The window watches the sensors in the toolbox as long as it shows them. */
  private tellOffered(): void {
    const offered = JSON.stringify(this.shown.offered);
    if (offered !== this.offered) this.bridge.offers(this.offered = offered);
  }

  /** The looks of the light theme while `draw` reads them. */
  private inLight<T>(draw: () => T): T {
    const {tokens, dark} = this.theme;
    if (dark) this.setTheme(tokens, false);  // nobody sees it: all is as before when the page is painted
    try {
      return draw();
    } finally {
      if (dark) this.setTheme(tokens, true);
    }
  }

  /** The window hears how many pages lie ready for the printer; "" when there is nothing to be seen. */
  private layPages({token, ...paper}: Paper & {token: number}): void {
    let count = 0;
    try {
      count = this.inLight(() => layPages(this.shown.workspace, paper));
    } finally {
      this.bridge.pictured(token, count ? `${count}` : '');
    }
  }

  /** The window gets "" when there is nothing to be seen. */
  private async takePicture({token, kind, white}: WantedPicture): Promise<void> {
    let data = '';
    try {
      const picture = await this.inLight(() => pictureOf(this.shown.workspace, white));
      if (picture) data = kind === 'svg' ? picture.svg : await asPng(picture);
    } finally {
      this.bridge.pictured(token, data);
    }
  }

  private setTheme(tokens: Tokens, dark: boolean): void {
    this.theme = {tokens, dark};
    useTokens(tokens, dark);
    setCssVariables(dark);
    this.tabs.themeChanged();
  }

  private makeZoomButtons(): void {
    const box = document.createElement('div');
    box.className = 'nepZoom';
    const buttons: [string, string, () => void][] = [
      ['zoom-in', t('Zoom in'), () => this.shown.workspace.zoomCenter(1)],
      ['zoom-out', t('Zoom out'), () => this.shown.workspace.zoomCenter(-1)],
      ['maximize', t('Show everything'), () => this.shown.fit()],
    ];
    for (const [icon, name, action] of buttons) {
      const button = document.createElement('button');
      button.type = 'button';
      button.title = name;
      button.setAttribute('aria-label', name);
      button.append(iconElement(icon, 18));
      button.onclick = action;
      box.append(button);
    }
    const bin = binButton();
    bin.onclick = (event) => this.shown.bin.toggle(event.detail === 0);
    const backpack = backpackButton();
    backpack.onclick = (event) => this.shown.backpack.toggle(event.detail === 0);
    box.prepend(frameButton(), bin, backpack);
    document.body.append(box);
    this.dressBin();
  }

  /** The bin's button says how many deletions wait in it. */
  private dressBin(): void {
    const count = this.shown.bin.size;
    const words = count ? t('Deleted blocks ({count})', {count}) : t('Deleted blocks');
    binButton().title = words;
    binButton().setAttribute('aria-label', words);
    binButton().classList.toggle('nepFull', count > 0);
  }
}

interface WantedPicture {
  token: number;
  kind: 'png' | 'svg';
  white: boolean;
}

interface Beginning {
  language: string;
  words: Record<string, string>;
  reduced: boolean;
  pinned: boolean | null;
  theme: {tokens: Tokens; dark: boolean};
}

/** Blockly's own words in this language, or in English when there are none; which it was. */
async function useLanguage(wanted: string): Promise<string> {
  for (const language of new Set([wanted, wanted.split(/[-_]/)[0] ?? '', 'en'])) {
    // A file that does not exist is a failed request in our scheme, not an answer with a status.
    const answer = await fetch(`msg/${encodeURIComponent(language.toLowerCase())}.json`).catch(() => null);
    if (!answer?.ok) continue;
    Blockly.setLocale(await answer.json() as Record<string, string>);
    return language;
  }
  throw new Error('no words for the block editor');
}

async function start(bridge: Bridge): Promise<void> {
  const beginning = JSON.parse(await bridge.beginning()) as Beginning;
  useTokens(beginning.theme.tokens, beginning.theme.dark);
  setCssVariables(beginning.theme.dark);
  document.documentElement.classList.toggle('reduced', beginning.reduced);
  useWords(beginning.words ?? {});
  const language = await useLanguage(beginning.language);
  giveBlocklyOurWords(language);
  trimMenu();
  useOwnKeys();
  // Blockly measures text once, so the fonts must be loaded before.
  const fonts = ['600 15px Inter', '500 14px Inter', ...(language === 'ja' ? ['600 15px "M PLUS 1p"'] : [])];
  await Promise.allSettled(fonts.map((font) => document.fonts.load(font)));
  const editor = new Editor(bridge, beginning.pinned, beginning.theme);
  followModality();
  const inbox = new Inbox((name, payload) => {
    try {
      editor.receive(name, payload);
    } catch (error) {
      bridge.failed(`${name}: ${error instanceof Error ? error.message : String(error)}`);
    }
  });
  bridge.told.connect((name, payload) => inbox.take(name, payload));
  window.addEventListener('error', (event) => bridge.failed(event.message));
  window.addEventListener('unhandledrejection', (event) => bridge.failed(String(event.reason)));
  bridge.ready();
}

new QWebChannel(qt.webChannelTransport, (channel) => void start(channel.objects.bridge));
