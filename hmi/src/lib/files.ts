/** Give the person a file, named by what it is and when. */
export function save(text: string, what: string, ending: string, type: string): void {
  const anchor = document.createElement('a');
  anchor.href = URL.createObjectURL(new Blob([text], { type }));
  anchor.download = `gantryctl_${what}_${new Date().toISOString().slice(0, 19).replaceAll(':', '')}.${ending}`;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 10_000);
}
