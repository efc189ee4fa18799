// The dialog "Connect a program": for each language the shortest program that drives, to copy.
import type { Store } from '../store'
import { copyButton } from './clipboard'
import { h, setText } from './element'
import { segments } from './fields'
import { addressOfPage, SNIPPETS } from './snippets'

export function connectDialog(store: Store): { element: HTMLDialogElement; open: () => void } {
  const note = h('p', { class: 'muted' })
  const code = h('pre', { testid: 'snippet', tabindex: 0, role: 'group', 'aria-label': 'Program' })
  const options = SNIPPETS.map(({ title }) => [title, title] as const)
  const languages = segments('language', 'Language', options, show)

  function show(language: string): void {
    const snippet = SNIPPETS.find(({ title }) => title === language) ?? SNIPPETS[0]
    languages.show(snippet.title)
    setText(note, snippet.note)
    setText(code, snippet.code(addressOfPage(), store.vehicle.value))
  }

  const element = h(
    'dialog',
    {
      class: 'help connect',
      testid: 'connect-dialog',
      'aria-label': 'Connect a program',
      onclick: (event: MouseEvent) => event.target === element && element.close(), // a click outside the content
    },
    h(
      'header',
      {},
      h('h2', {}, 'Connect a program'),
      h('button', { testid: 'connect-close', onclick: () => element.close() }, 'Close'),
    ),
    h(
      'div',
      { class: 'connect-body' },
      languages.element,
      note,
      code,
      h('div', { class: 'row' }, copyButton('copy', code, { isPrimary: true })),
    ),
  )

  function open(): void {
    show(SNIPPETS[0].title)
    element.showModal()
  }

  return { element, open }
}
