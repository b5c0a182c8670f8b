"""Messages and enumerations of proto/*.proto by name: messages.Record, messages.TEMPERATURE, messages.ControlRequest.

Made from the descriptors in messages.binpb, and not generated as modules, because generated modules work only with some
versions of protobuf. Works with protobuf 3.12 and newer. The descriptors have a pool of their own, so a program may also
load modules that protoc made from proto/; their messages are other classes. messages.Any is google.protobuf.Any of this
pool.
"""
import pathlib
from typing import Any as _Type

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.internal.enum_type_wrapper import EnumTypeWrapper

_POOL = descriptor_pool.DescriptorPool()
_FILES = descriptor_pb2.FileDescriptorSet.FromString((pathlib.Path(__file__).parent / "messages.binpb").read_bytes())
for _file in _FILES.file:  # Imports come before the files that import them.
    _POOL.AddSerializedFile(_file.SerializeToString())

if hasattr(message_factory, "GetMessageClass"):  # Since protobuf 4.22.
    _class_of = message_factory.GetMessageClass
else:
    _class_of = message_factory.MessageFactory(_POOL).GetPrototype

for _file in _FILES.file:
    if _file.package != "moondb.proto":
        continue
    for _message in _file.message_type:
        globals()[_message.name] = _class_of(_POOL.FindMessageTypeByName(f"moondb.proto.{_message.name}"))
    for _enum in _file.enum_type:
        # With Name(number) and Value(name), as in generated modules.
        globals()[_enum.name] = EnumTypeWrapper(_POOL.FindEnumTypeByName(f"moondb.proto.{_enum.name}"))
        for _value in _enum.value:
            globals()[_value.name] = _value.number
Any = _class_of(_POOL.FindMessageTypeByName("google.protobuf.Any"))


def __getattr__(name: str) -> _Type:
    raise AttributeError(f"moondb has no message and no enumerator {name} (proto/*.proto)")
