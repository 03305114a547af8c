using System;

namespace Nep
{
    /// <summary>Base class of the library's exceptions.</summary>
    public class NepException : Exception
    {
        /// <summary>Create an exception with a message.</summary>
        /// <param name="message">Description of the problem and its solution.</param>
        public NepException(string message) : base(message)
        {
        }

        /// <summary>Create an exception with a message and its cause.</summary>
        /// <param name="message">Description of the problem and its solution.</param>
        /// <param name="inner">Cause of this exception.</param>
        public NepException(string message, Exception inner) : base(message, inner)
        {
        }
    }

    /// <summary>No master replied before the timeout.</summary>
    public sealed class MasterUnreachableException : NepException
    {
        internal MasterUnreachableException(string address, string message) : base(message)
        {
            Address = address;
        }

        /// <summary>Address of the master, as <c>HOST:PORT</c>.</summary>
        public string Address { get; private set; }
    }

    /// <summary>The master or a server rejected a request; the message contains the reason.</summary>
    public sealed class RequestRefusedException : NepException
    {
        internal RequestRefusedException(string reason) : base(reason)
        {
        }
    }

    /// <summary>A payload can't be encoded or decoded by the codec of its topic.</summary>
    public sealed class PayloadException : NepException
    {
        internal PayloadException(string message) : base(message)
        {
        }

        internal PayloadException(string message, Exception inner) : base(message, inner)
        {
        }
    }
}
