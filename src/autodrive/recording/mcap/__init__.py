"""Reads and writes files in the format MCAP (https://mcap.dev/spec): messages with a time, in compressed chunks.

We have our own reader and writer instead of those of the package `mcap` (measured with 1.6.0), whose `Writer.flush` can
end a chunk at any time, too. Its writer compresses all chunks with one level, which costs another 0.4 % of a core with
two cameras, and writes schemas and channels only inside chunks: if one chunk of a file that was cut off is damaged, all
later messages can lose their topic. Its reader ends at the first damaged record: of 13,000 mutated recordings it gave
a quarter fewer messages. It does not check the checksums of summary and attachments, and asks for as much memory as a
damaged length says (gigabytes for 12 of these files). Most of our reader would remain around its records.
"""

from autodrive.recording.mcap.reader import LEAST_CHUNKS as LEAST_CHUNKS
from autodrive.recording.mcap.reader import MAX_CHUNK as MAX_CHUNK
from autodrive.recording.mcap.reader import MAX_MESSAGES as MAX_MESSAGES
from autodrive.recording.mcap.reader import NO_MESSAGES as NO_MESSAGES
from autodrive.recording.mcap.reader import ChunkMessages as ChunkMessages
from autodrive.recording.mcap.reader import Reader as Reader
from autodrive.recording.mcap.records import McapChannel as McapChannel
from autodrive.recording.mcap.records import McapMessage as McapMessage
from autodrive.recording.mcap.records import Schema as Schema
from autodrive.recording.mcap.writer import LEVEL as LEVEL
from autodrive.recording.mcap.writer import PACKED_LEVEL as PACKED_LEVEL
from autodrive.recording.mcap.writer import Chunk as Chunk
from autodrive.recording.mcap.writer import Writer as Writer
from autodrive.recording.mcap.writer import header as header
