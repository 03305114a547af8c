// The page of the block editor: what the window tells it (`nepReceive`) and what it tells the window.
import * as Blockly from 'blockly/core';
import {type BlockDefinition, define, defineSources} from './definitions';
import {FieldChoice, type Option} from './choices';
import './fields';
import {iconElement} from './icons';
import {trimMenu} from './menu';
import {CHECKER, Program, holdsAny} from './program';
import {RENDERER} from './renderer';
import {States} from './states';
import {makeTheme, putVariables} from './theme';
import {type Tokens, useTokens} from './tokens';
import {Toolbox} from './toolbox';

interface Bridge {
  told: {connect(slot: (name: string, payload: string) => void): void};
  beginning(): Promise<string>;
  ready(): void;
  changed(generation: number, json: string): void;
  history(canUndo: boolean, canRedo: boolean): void;
  selected(id: string): void;
  flushed(token: number, json: string): void;
  failed(sentence: string): void;
}

declare const QWebChannel: new (transport: unknown, done: (channel: {objects: {bridge: Bridge}}) => void) => unknown;
declare const qt: {webChannelTransport: unknown};

const SCALE = 0.8;
const BUSY_MS = 60;

interface Definitions {
  blocks?: BlockDefinition[];
  toolbox?: {contents?: unknown[]};
  topics?: string[];
  sources?: Record<string, Option[]>;
}

class Editor {
  private readonly workspace: Blockly.WorkspaceSvg;
  private readonly program: Program;
  private readonly states: States;
  private generation = 0;
  private waiting: Definitions | null = null;

  constructor(private readonly bridge: Bridge) {
    this.workspace = Blockly.inject('workspace', {
      media: 'media/', renderer: RENDERER, sounds: false, trashcan: false, theme: makeTheme(),
      toolbox: {kind: 'categoryToolbox', contents: []},
      plugins: {toolbox: Toolbox, [Blockly.registry.Type.CONNECTION_CHECKER.toString()]: CHECKER},
      grid: {spacing: 28, length: 2, snap: true, colour: 'transparent'},
      move: {scrollbars: true, drag: true, wheel: true},
      zoom: {controls: false, wheel: true, pinch: true, startScale: SCALE, minScale: 0.3, maxScale: 2},
    });
    this.program = new Program(this.workspace, {
      changed: (json) => bridge.changed(this.generation, json),
      history: (canUndo, canRedo) => bridge.history(canUndo, canRedo),
      selected: (id) => bridge.selected(id),
    });
    this.states = new States(this.workspace);
    this.workspace.registerButtonCallback('CREATE_VARIABLE', (button) =>
      Blockly.Variables.createVariableButtonHandler(button.getTargetWorkspace()));
    new ResizeObserver(() => Blockly.svgResize(this.workspace)).observe(document.body);
    this.makeZoomButtons();
  }

  receive(name: string, payload: string): void {
    const command = this.commands[name];
    if (!command) throw new Error(`no command ${name}`);
    command(JSON.parse(payload) as never);
  }

  private readonly commands: Record<string, (payload: never) => void> = {
    theme: (it: {tokens: Tokens; dark: boolean}) => this.setTheme(it.tokens, it.dark),
    motion: (it: {reduced: boolean}) => document.documentElement.classList.toggle('reduced', it.reduced),
    definitions: (it: Definitions) => this.setDefinitions(it),
    load: (it: {generation: number; workspace: Record<string, unknown>}) => this.load(it.generation, it.workspace),
    highlight: (ids: string[]) => this.states.highlight(ids),
    stopped: (ids: string[]) => this.states.markStopped(ids),
    errors: (errors: Record<string, string>) => this.states.setErrors(errors),
    absent: (ids: string[]) => this.states.setAbsent(ids),
    live: (values: Record<string, string>) => this.states.setLive(values),
    flush: (token: number) => this.bridge.flushed(token, this.program.flush()),
    undo: () => this.program.undo(false),
    redo: () => this.program.undo(true),
    zoom: (steps: number) => this.workspace.zoomCenter(steps),
    fit: () => this.fit(),
    show: (id: string) => this.show(id),
  };

  private setTheme(tokens: Tokens, dark: boolean): void {
    useTokens(tokens, dark);
    putVariables(dark);
    this.workspace.setTheme(makeTheme());
    this.states.restore();
  }

  private load(generation: number, state: Record<string, unknown>): void {
    this.workspace.hideChaff();
    this.workspace.getGesture(new PointerEvent('pointercancel'))?.cancel();
    this.applyWaiting();
    this.program.load(state);
    this.generation = generation;
    this.states.restore();
  }

  /** Waits while a block is in the hand or a field is open: nobody's drag is broken by a robot that connects. */
  private setDefinitions(definitions: Definitions): void {
    const first = this.waiting === null;
    this.waiting = definitions;
    if (first) this.applyWhenIdle();
  }

  private applyWhenIdle(): void {
    const busy = Blockly.Gesture.inProgress() || this.workspace.isDragging() ||
      Blockly.WidgetDiv.isVisible() || Blockly.DropDownDiv.isVisible() ||
      document.querySelector('dialog[open]') !== null;
    if (busy && this.waiting) window.setTimeout(() => this.applyWhenIdle(), BUSY_MS);
    else this.applyWaiting();
  }

  private applyWaiting(): void {
    const definitions = this.waiting;
    this.waiting = null;
    if (!definitions) return;
    const {changed, sources} = define(definitions.blocks ?? []);
    const topics = (definitions.topics ?? []).map((each): Option => [each, each]);
    const more = defineSources({topics, ...definitions.sources});
    if (changed.size && holdsAny(this.workspace, changed)) {
      this.program.flush();
      this.program.rebuild();
      this.states.restore();
    }
    const toolbox = this.workspace.getToolbox();
    if (toolbox instanceof Toolbox) toolbox.update({contents: [], ...definitions.toolbox}, changed.size > 0);
    if (sources || more) this.refreshChoices();
  }

  private refreshChoices(): void {
    const flyout = this.workspace.getFlyout()?.getWorkspace();
    for (const workspace of flyout ? [this.workspace, flyout] : [this.workspace]) {
      for (const block of workspace.getAllBlocks(false)) {
        for (const field of block.getFields()) if (field instanceof FieldChoice) field.refresh();
      }
    }
  }

  private fit(): void {
    if (!this.workspace.getTopBlocks(false).length) return;
    this.workspace.zoomToFit();
    if (this.workspace.scale > 1) {
      this.workspace.setScale(1);
      this.workspace.scrollCenter();
    }
  }

  private show(id: string): void {
    const block = this.workspace.getBlockById(id);
    if (!block) return;
    this.workspace.centerOnBlock(id, true);
    Blockly.getFocusManager().focusNode(block);
  }

  private makeZoomButtons(): void {
    const box = document.createElement('div');
    box.className = 'nepZoom';
    const buttons: [string, string, () => void][] = [
      ['zoom-in', 'Zoom in', () => this.workspace.zoomCenter(1)],
      ['zoom-out', 'Zoom out', () => this.workspace.zoomCenter(-1)],
      ['maximize', 'Show everything', () => this.fit()],
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
    document.body.append(box);
  }
}

interface Beginning {
  language: string;
  reduced: boolean;
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
  putVariables(beginning.theme.dark);
  document.documentElement.classList.toggle('reduced', beginning.reduced);
  const language = await useLanguage(beginning.language);
  trimMenu(language);
  // Blockly measures text once; the font has to be there before.
  await Promise.allSettled([document.fonts.load('600 15px Inter'), document.fonts.load('500 14px Inter')]);
  const editor = new Editor(bridge);
  bridge.told.connect((name, payload) => {
    try {
      editor.receive(name, payload);
    } catch (error) {
      bridge.failed(`${name}: ${error instanceof Error ? error.message : String(error)}`);
    }
  });
  window.addEventListener('error', (event) => bridge.failed(event.message));
  window.addEventListener('unhandledrejection', (event) => bridge.failed(String(event.reason)));
  bridge.ready();
}

new QWebChannel(qt.webChannelTransport, (channel) => void start(channel.objects.bridge));
