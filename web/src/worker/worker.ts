// Entry point of the worker of the page: it keeps the connection and drives while the page draws.
import type { Port, WorkerMessage } from './port'
import { serve } from './serve'

serve(self as unknown as Port<WorkerMessage>)
