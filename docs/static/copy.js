// A button on each block of code copies its commands: without the $ of a prompt, and without output.
for (const block of document.querySelectorAll('.highlight pre')) {
  const button = Object.assign(document.createElement('button'), {
    className: 'copy', textContent: 'Copy', type: 'button', title: 'copy the commands' });
  const lines = block.innerText.replace(/\n$/, '').split('\n');
  const commands = lines.filter((line) => line.startsWith('$ '));
  const text = commands.length ? commands.map((line) => line.slice(2)) : lines;
  button.onclick = async () => {
    await navigator.clipboard.writeText(`${text.join('\n')}\n`);
    button.textContent = 'Copied';
    setTimeout(() => { button.textContent = 'Copy'; }, 1500);
  };
  block.parentElement.append(button);
}
