namespace Nep
{
    /// <summary>No server of the service was reached before the timeout; nothing was sent.</summary>
    public sealed class NoServerException : NepException
    {
        internal NoServerException(string service) : base("No server of '" + service + "' was reached in time. Is its program running?")
        {
        }
    }

    /// <summary>A call was sent, and no reply arrived before the timeout; it may still be executed.</summary>
    public sealed class ServiceTimeoutException : NepException
    {
        internal ServiceTimeoutException(string service) : base("'" + service + "' did not reply in time; it may still execute the call.")
        {
        }
    }

    /// <summary>The server exited during a call, which may or may not have been executed.</summary>
    public sealed class ServerGoneException : NepException
    {
        internal ServerGoneException(string service) : base("The server of '" + service + "' exited during the call.")
        {
        }
    }

    /// <summary>The server's callback threw an exception.</summary>
    public sealed class ServiceException : NepException
    {
        internal ServiceException(string kind, string reason) : base(reason)
        {
            Kind = kind;
        }

        /// <summary>Class of the exception at the server, such as <c>ValueError</c>.</summary>
        public string Kind { get; private set; }
    }
}
