using System;

namespace Nep
{
    /// <summary>Base class of the exceptions of this library.</summary>
    public class NepException : Exception
    {
        /// <summary>Create an exception with a message.</summary>
        /// <param name="message">What happened and what to do about it.</param>
        public NepException(string message) : base(message)
        {
        }

        /// <summary>Create an exception with a message and its cause.</summary>
        /// <param name="message">What happened and what to do about it.</param>
        /// <param name="inner">Exception that led to this one.</param>
        public NepException(string message, Exception inner) : base(message, inner)
        {
        }
    }

    /// <summary>No master answered within the timeout.</summary>
    public sealed class MasterUnreachableException : NepException
    {
        internal MasterUnreachableException(string address, string message) : base(message)
        {
            Address = address;
        }

        /// <summary>Address that was tried, as <c>HOST:PORT</c>.</summary>
        public string Address { get; private set; }
    }

    /// <summary>The master refused a registration; the message has its reason.</summary>
    public sealed class RequestRefusedException : NepException
    {
        internal RequestRefusedException(string reason) : base(reason)
        {
        }
    }

    /// <summary>A payload can't be converted to or from the codec of its topic.</summary>
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
