import { readFileSync } from 'node:fs';

/** The licence of uPlot wants to go with every copy; a minifier would drop it. */
export function withLicence() {
  const licence = readFileSync('node_modules/uplot/LICENSE', 'utf-8').trim();
  const { version } = JSON.parse(readFileSync('node_modules/uplot/package.json', 'utf-8'));
  const notice = `/* Contains uPlot ${version}.\n${licence} */\n`;
  return {
    name: 'with-licence',
    enforce: 'post',
    generateBundle(_, bundle) {
      for (const made of Object.values(bundle)) if (made.type === 'chunk') made.code = notice + made.code;
    },
  };
}
