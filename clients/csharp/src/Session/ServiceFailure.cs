using System;
using System.Collections.Generic;
using Nep.Wire;

namespace Nep.Session
{
    /// <summary>Payload of an error or rejection.</summary>
    internal static class ServiceFailure
    {
        public static byte[] Encode(string kind, string reason)
        {
            var failure = new Dictionary<string, string> { { "nep_error", kind }, { "reason", reason } };
            return Codec.CheckedJson(Json.Serializer.Serialize(failure));
        }

        public static NepException Decode(byte kind, byte[] payload)
        {
            Dictionary<string, string> failure = null;
            try
            {
                string text = Names.StrictUtf8.GetString(payload);
                failure = (Dictionary<string, string>)Json.Serializer.Deserialize(text, typeof(Dictionary<string, string>));
            }
            catch (Exception) // malformed payload
            {
            }
            string name = "", reason = "the server gave no reason";
            if (failure != null)
            {
                failure.TryGetValue("nep_error", out name);
                failure.TryGetValue("reason", out reason);
            }
            return kind == ServiceHeader.Error ? (NepException)new ServiceException(name, reason) : new RequestRefusedException(reason);
        }
    }
}
