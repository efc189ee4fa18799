// The bridge section of the menu: IP address, port, connection button and status.
import { sentence } from '../actions'
import type { Connection } from '../connection'
import type { BridgeStatus } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'
import { state } from './fields'
import { busy } from './pending'
import { loadPreference, savePreference } from './preferences'

const DEFAULTS = { host: '127.0.0.1', port: '4567' }
const HINT = 'Start your devkit script first. It listens at this address; port 4567 is the default.'
const STATES = { closed: 'Disconnected', connecting: 'Connecting…', connected: 'Connected' }

/** `showPrograms` shows programs that connect to the simulator. */
export function bridge(store: Store, connection: Connection, showPrograms: () => void): HTMLElement {
  const typed = { ...DEFAULTS }
  const host = h('input', { testid: 'ip', placeholder: DEFAULTS.host, oninput: saveInput, ...FIELD })
  const digits = { inputmode: 'numeric' }
  const port = h('input', { testid: 'port', placeholder: DEFAULTS.port, oninput: saveInput, ...digits, ...FIELD })
  const connect = h('button', { testid: 'connect', class: 'primary', type: 'submit' }, 'Connect')
  const disconnect = h(
    'button',
    { testid: 'disconnect', type: 'button', onclick: () => void busy(disconnect, end) },
    'Disconnect',
  )
  const status = state('bridge-status')
  const error = h('p', { class: 'error', testid: 'bridge-error', id: 'bridge-error', role: 'alert', hidden: true })
  const hint = h('p', { class: 'muted' }, HINT)
  const script = h('p', { class: 'note', testid: 'bridge-script', hidden: true })
  let refusal = ''

  function saveInput(): void {
    typed.host = host.value
    typed.port = port.value
    refuse('')
  }

  function refuse(message: string, field?: HTMLInputElement): void {
    refusal = message
    for (const each of [host, port]) each.setAttribute('aria-invalid', String(each === field))
    show(store.status.value?.bridge)
    field?.focus()
  }

  async function start(event: Event): Promise<void> {
    event.preventDefault()
    const address = host.value.trim()
    if (!address) return refuse('The IP address is empty. The default is 127.0.0.1 (this machine).', host)
    if (/[\s/:]/.test(address.replace(/^\[.*\]$|^[0-9a-f:]+$/i, '')))
      return refuse('Enter only the address, without http:// and without the port. Example: 192.168.0.12.', host)
    if (!/^\d+$/.test(port.value.trim()))
      return refuse('The port must be a number from 1 to 65535. The default is 4567.', port)
    const number = Number(port.value)
    if (number < 1 || number > 65535) return refuse(`Port ${number} is out of range. Use 1 to 65535.`, port)
    refuse('')
    if (document.activeElement instanceof HTMLInputElement) document.activeElement.blur()
    await busy(connect, async () => {
      try {
        await connection.request({ type: 'ConnectBridge', host: address, port: number })
      } catch (reason) {
        refuse(sentence(reason))
      }
    })
    show(store.status.value?.bridge)
  }

  async function end(): Promise<void> {
    refuse('')
    try {
      await connection.request({ type: 'DisconnectBridge' })
    } catch (reason) {
      refuse(sentence(reason))
    }
  }

  function show(bridge: BridgeStatus | undefined): void {
    const now = bridge?.state ?? 'closed'
    const isOpen = now !== 'closed'
    const reason = store.refused.value.ConnectBridge
    connect.disabled = isOpen || store.link.value !== 'open' || reason !== undefined
    connect.title = reason ? sentence(reason) : ''
    connect.hidden = isOpen
    disconnect.hidden = !isOpen
    host.disabled = port.disabled = isOpen
    const at = bridge && isOpen ? splitAddress(bridge.address) : typed
    if (host.value !== at.host) host.value = at.host
    if (port.value !== at.port) port.value = at.port
    setText(status, STATES[now])
    status.dataset.state = now
    const text = refusal || (bridge && now !== 'connected' && bridge.error ? sentence(bridge.error) : '')
    setText(error, text)
    error.hidden = !text
    setText(script, [bridge?.devkit && sentence(bridge.devkit), bridge?.note].filter(Boolean).join(' '))
    script.hidden = Boolean(text) || !script.textContent
    hint.hidden = Boolean(text) || !script.hidden // one text at a time
  }

  store.status.watch((status) => show(status?.bridge))
  store.link.watch(() => show(store.status.value?.bridge))
  store.resets.watch(() => {
    Object.assign(typed, DEFAULTS)
    refuse('')
  })
  const programs = h('button', { class: 'quiet', testid: 'programs', onclick: showPrograms }, 'Python, ROS, C++…')
  const details = h(
    'details',
    { testid: 'bridge', open: loadPreference('bridge') === 'open' },
    h('summary', {}, 'Devkit script', status),
    h(
      'form',
      { class: 'bridge', novalidate: true, onsubmit: (event: Event) => void start(event) },
      h('div', { class: 'address' }, labelledField('IP Address', host), labelledField('Port Number', port)),
      h('div', { class: 'connects' }, connect, disconnect),
      h('div', { class: 'below' }, hint, error, script),
    ),
  )
  details.addEventListener('toggle', () => savePreference('bridge', details.open ? 'open' : 'closed'))
  let wasUsed = false
  store.status.watch((now) => {
    const isUsed = now !== null && (now.bridge.state !== 'closed' || now.bridge.error !== '')
    if (isUsed && !wasUsed) details.open = true // what connects is seen
    wasUsed = isUsed
  })
  return h(
    'section',
    { class: 'section' },
    h('div', { class: 'heading' }, h('h2', {}, 'Programs'), programs),
    h('p', { class: 'muted' }, 'A program of yours drives in Autonomous mode.'),
    details,
  )
}

const FIELD = {
  type: 'text',
  autocomplete: 'off',
  autocapitalize: 'off',
  spellcheck: 'false',
  'aria-describedby': 'bridge-error',
}

function labelledField(label: string, field: HTMLElement): HTMLElement {
  return h('label', { class: 'named' }, h('span', {}, label), field)
}

function splitAddress(address: string): { host: string; port: string } {
  const end = address.lastIndexOf(':')
  return { host: address.slice(0, end), port: address.slice(end + 1) }
}
