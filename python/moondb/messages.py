"""Messages and enumerations of proto/*.proto by name: messages.Record, messages.TEMPERATURE, messages.ControlRequest.

Made from the descriptors in messages.binpb, and not generated as modules, because generated modules work only with some
versions of protobuf. Works with protobuf 3.12 and newer.
"""
import pathlib
from typing import Any

from google.protobuf import any_pb2  # noqa: F401  control.proto imports it.
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory


def _class_of(descriptor: Any) -> Any:
    if hasattr(message_factory, "GetMessageClass"):  # Since protobuf 4.22.
        return message_factory.GetMessageClass(descriptor)
    return _FACTORY.GetPrototype(descriptor)


_POOL = descriptor_pool.Default()
_FACTORY = message_factory.MessageFactory(_POOL) if not hasattr(message_factory, "GetMessageClass") else None
_FILES = descriptor_pb2.FileDescriptorSet.FromString((pathlib.Path(__file__).parent / "messages.binpb").read_bytes())
for _file in _FILES.file:
    if not _file.name.startswith("google/"):
        _POOL.AddSerializedFile(_file.SerializeToString())
for _file in _FILES.file:
    if _file.package != "moondb.proto":
        continue
    for _message in _file.message_type:
        globals()[_message.name] = _class_of(_POOL.FindMessageTypeByName(f"moondb.proto.{_message.name}"))
    for _enum in _file.enum_type:
        for _value in _enum.value:
            globals()[_value.name] = _value.number


def __getattr__(name: str) -> Any:
    raise AttributeError(f"moondb has no message and no enumerator {name} (proto/*.proto)")
