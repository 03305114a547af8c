using System;

namespace Nep.Wire
{
    /// <summary>Malformed data of the native wire. <see cref="Code"/> is the same in every language: see docs/wire.md.</summary>
    internal sealed class WireException : Exception
    {
        public WireException(string code) : base("the message is malformed: " + code)
        {
            Code = code;
        }

        public string Code { get; private set; }
    }
}
