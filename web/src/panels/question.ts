// A dialog that asks one question: what the user chose, or nothing if the dialog was closed.
import { type Child, h } from './element'

/** A choice: its value, its label, and whether Enter chooses it. */
export type Choice = readonly [value: string, label: string, isPrimary?: boolean]

/** Shows a question with its choices; resolves to the value of the choice, or '' if the dialog was closed. */
export function ask(
  testid: string,
  title: string,
  content: readonly Child[],
  choices: readonly Choice[],
): Promise<string> {
  const buttons = choices.map(([value, label, isPrimary]) =>
    h(
      'button',
      { value, testid: `${testid}-${value}`, class: isPrimary && 'primary', type: isPrimary ? 'submit' : 'button' },
      label,
    ),
  )
  const cancel = h('button', { type: 'button', testid: `${testid}-cancel` }, 'Cancel')
  const form = h(
    'form',
    { method: 'dialog', class: 'question-body' },
    ...content,
    h('div', { class: 'row' }, cancel, ...buttons),
  )
  const heading = h('header', {}, h('h2', {}, title))
  const dialog = h('dialog', { class: 'help question', testid, 'aria-label': title }, heading, form)
  for (const button of [cancel, ...buttons.filter(({ type }) => type === 'button')])
    button.addEventListener('click', () => dialog.close(button.value))
  document.body.append(dialog)
  dialog.showModal()
  return new Promise((resolve) => {
    dialog.addEventListener('close', () => {
      dialog.remove()
      resolve(dialog.returnValue)
    })
  })
}
