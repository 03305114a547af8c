// Builds the block editor: `node build.mjs [folder]` (default: resources/blockly of the repository).
// The result is committed, so Studio needs no node; a test rebuilds it and compares.
import {build} from 'esbuild';
import {cp, mkdir, readFile, readdir, rm, writeFile} from 'node:fs/promises';
import {dirname, join, resolve} from 'node:path';
import {fileURLToPath} from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const target = resolve(process.argv[2] ?? join(here, '..', '..', '..', 'resources', 'blockly'));
const modules = join(here, 'node_modules');
const languages = ['en', 'de', 'es', 'fr', 'ja', 'pt-br'];
const media = ['sprites.svg', 'handclosed.cur', 'handdelete.cur', 'handopen.cur', 'dropdown-arrow.svg',
  'delete-icon.svg', 'foldout-icon.svg', 'resize-handle.svg', '1x1.gif'];

/** The chosen Lucide icons as one object: name -> the markup inside its <svg>. */
async function icons() {
  const names = JSON.parse(await readFile(join(here, 'src', 'icon_names.json'), 'utf8'));
  const result = {};
  for (const name of [...names].sort()) {
    const svg = await readFile(join(modules, 'lucide-static', 'icons', `${name}.svg`), 'utf8');
    const inside = svg.slice(svg.indexOf('>', svg.indexOf('<svg')) + 1, svg.lastIndexOf('</svg>'));
    result[name] = inside.replace(/\s*\n\s*/g, '').replace(/ \/>/g, '/>');
  }
  return result;
}

const iconPlugin = {
  name: 'icons',
  setup(plugin) {
    plugin.onResolve({filter: /^virtual:icons$/}, () => ({path: 'icons', namespace: 'virtual'}));
    plugin.onLoad({filter: /.*/, namespace: 'virtual'}, async () => ({
      contents: JSON.stringify(await icons()), loader: 'json',
    }));
  },
};

async function legal() {
  const parts = [];
  for (const [name, file] of [['blockly', 'LICENSE'], ['lucide-static', 'LICENSE']]) {
    const about = JSON.parse(await readFile(join(modules, name, 'package.json'), 'utf8'));
    const text = await readFile(join(modules, name, file), 'utf8');
    parts.push(`${about.name} ${about.version} (${about.license})\n\n${text.trim()}\n`);
  }
  return `Third-party work inside this folder\n\n${parts.join('\n' + '-'.repeat(78) + '\n\n')}`;
}

async function messages(language) {
  const text = await readFile(join(modules, 'blockly', 'msg', `${language}.js`), 'utf8');
  const found = {};
  // The files assign `Blockly.Msg["KEY"] = "text";`, one a line.
  for (const match of text.matchAll(/Msg\["([A-Z0-9_a-z]+)"\]\s*=\s*("(?:[^"\\]|\\.)*");/g)) {
    found[match[1]] = JSON.parse(match[2]);
  }
  if (Object.keys(found).length < 100) throw new Error(`no messages found in ${language}.js`);
  return JSON.stringify(found, null, 0) + '\n';
}

await mkdir(target, {recursive: true});
for (const name of await readdir(target)) await rm(join(target, name), {recursive: true});
await build({
  entryPoints: [join(here, 'src', 'main.ts')],
  outfile: join(target, 'editor.js'),
  bundle: true, minify: true, format: 'iife', target: 'chrome120', charset: 'utf8',
  legalComments: 'none', plugins: [iconPlugin], logLevel: 'warning',
});
await mkdir(join(target, 'media'));
for (const name of media) await cp(join(modules, 'blockly', 'media', name), join(target, 'media', name));
await mkdir(join(target, 'msg'));
for (const language of languages) {
  await writeFile(join(target, 'msg', `${language}.json`), await messages(language));
}
await cp(join(here, 'src', 'index.html'), join(target, 'index.html'));
await cp(join(here, 'src', 'style.css'), join(target, 'style.css'));
await writeFile(join(target, 'LEGAL.txt'), await legal());
