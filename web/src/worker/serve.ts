// The work of the worker: passes messages between the page and the simulator, and sends the commands of the user.
import { CommandSender } from './command_sender'
import { Link } from './link'
import { Outbox } from './outbox'
import type { PageMessage, Port, WorkerMessage } from './port'

/** Serves the page at the other end of `port`. */
export function serve(port: Port<WorkerMessage>): void {
  const outbox = new Outbox((message) => port.postMessage(message))
  const link = new Link((message) => {
    if (message.type === 'Frame') commands.frame = message
    if (message.type === 'Response') commands.frame = message.frame
    if (message.type === 'Silence') commands.lose()
    outbox.add(message)
  })
  const commands = new CommandSender(
    (message) => link.send(message),
    (vehicle) => outbox.add({ type: 'Blocked', vehicle }),
  )

  function receive(message: PageMessage): void {
    commands.onSignOfLife()
    if (message.type === 'Open') link.open(message.url)
    else if (message.type === 'Subscribe') link.subscribe(message)
    else if (message.type === 'Request') link.send(message)
    else if (message.type === 'Select') commands.select(message.vehicle)
    else if (message.type === 'Inputs') commands.change(message.keys, message.direct)
    else if (message.type === 'Stop') commands.stop()
    else if (message.type === 'Toggle') commands.toggle(message)
    else outbox.release()
  }

  port.addEventListener('message', (event: MessageEvent<PageMessage>) => receive(event.data))
}
