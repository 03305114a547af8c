namespace Nep
{
    /// <summary>No server of the service was reached in time; nothing was sent.</summary>
    public sealed class NoServerException : NepException
    {
        internal NoServerException(string service) : base("No server of '" + service + "' was reached in time. Is its program running?")
        {
        }
    }

    /// <summary>A call was sent and no answer came in time; it may still be carried out.</summary>
    public sealed class ServiceTimeoutException : NepException
    {
        internal ServiceTimeoutException(string service) : base("'" + service + "' did not answer in time.")
        {
        }
    }

    /// <summary>The server ended during a call; nobody knows whether it was carried out.</summary>
    public sealed class ServerGoneException : NepException
    {
        internal ServerGoneException(string service) : base("The server of '" + service + "' ended during the call.")
        {
        }
    }

    /// <summary>The server's callback failed.</summary>
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
